# SPDX-License-Identifier: Apache-2.0
"""Free-space violations, of which a lone object may have fewer."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate import free_space
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import refuse
from registration.gate.samples import CUP
from registration.samples import candidate

LIMITS = free_space.Limits(violations=0.07, certain_doubtful=0.012, certain_few=0.015)


@pytest.mark.parametrize(
    ("violations", "certain", "doubtful", "text"),
    [
        (0.07, 0.9, False, None),
        (0.071, 0.0, False, "violations 0.071 > 0.070"),
        (0.07, 0.012, True, None),
        (0.07, 0.013, True, "0.013 float > 0.012"),
    ],
)
def test_certain_violations_count_where_the_pose_is_doubtful(
    violations: float, certain: float, doubtful: bool, text: str | None
) -> None:
    refusal = free_space.check(violations, certain, doubtful, LIMITS)
    assert refusal == (None if text is None else (Reason.FREE_SPACE, text))


def test_certain_violations_count_where_few_objects_are_matched() -> None:
    assert free_space.check_few(0.9, False, LIMITS) is None and free_space.check_few(0.015, True, LIMITS) is None
    assert free_space.check_few(0.016, True, LIMITS) == (Reason.FREE_SPACE, "0.016 float > 0.015")


def test_a_share_of_violations_is_allowed() -> None:
    assert free_space.check_violations(0.1, 0.1) is None
    assert free_space.check_violations(0.2, 0.1) == (Reason.FREE_SPACE, "violations 0.200 > 0.100")


def test_a_lone_object_must_respect_free_space_more_than_several() -> None:
    far = {"certain_violations": 0.5 * (GATE.free_space.certain_doubtful + GATE.free_space.certain_few)}
    refusal = refuse(candidate(matched=(CUP,), margin_over_competing=1.0, **far))
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
    assert refuse(candidate(**far)) is None


def test_several_objects_that_look_otherwise_may_not_float_either() -> None:
    far = {"certain_violations": 0.5 * (GATE.free_space.certain_doubtful + GATE.free_space.certain_few)}
    assert refuse(candidate(**far, silhouette_score=0.0)) is None
    refusal = refuse(candidate(**far, silhouette_score=GATE.appearance.silhouette_score_with_grey - 0.1))
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE


def test_two_objects_may_both_have_moved_but_three_stand_where_they_stood() -> None:
    far, three = 1.1 * GATE.free_space.certain_few, tuple(ObjectPair(k, k, "cup") for k in range(3))
    refusal = refuse(candidate(certain_violations=far))
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
    assert refuse(candidate(certain_violations=far, matched=three)) is None
