# SPDX-License-Identifier: Apache-2.0
"""Which constraints two runs of robots have in common."""

from __future__ import annotations

from typing import Any

SECOND = 1_000_000_000


def moments(from_robot: str, from_s: float, to_robot: str, to_s: float) -> list[Any]:
    return [from_robot, to_robot, round(from_s * SECOND), round(to_s * SECOND)]


def test_constraints_are_alike_a_second_off_and_from_either_end() -> None:
    from team_figures import are_alike

    one = moments("r1", 10.0, "r2", 20.0)
    assert are_alike(one, moments("r1", 10.9, "r2", 19.1))
    assert are_alike(one, moments("r2", 20.5, "r1", 9.5))
    assert not are_alike(one, moments("r1", 11.1, "r2", 20.0))
    assert not are_alike(one, moments("r2", 10.0, "r1", 20.0))
    assert not are_alike(one, moments("r1", 10.0, "r1", 20.0))


def test_each_constraint_is_in_common_once() -> None:
    from team_figures import in_common

    base = [moments("r1", 10.0, "r2", 20.0), moments("r1", 10.5, "r2", 20.0), moments("r1", 5.0, "r1", 50.0)]
    assert in_common(base, [moments("r2", 20.0, "r1", 10.2), moments("r1", 50.0, "r1", 5.0)]) == 2
    assert in_common(base, base[::-1]) == 3
