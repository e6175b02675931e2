# SPDX-License-Identifier: Apache-2.0
"""Poses between two passes of a corridor, by an odometry that is right or drifts."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import SECOND, moved

from objreg_ros.data import Array
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registrar.consistency import MOST, REACH_M, Consistency, Standpoint, Statement

TRUE = moved(0.0, 0.0, 0.3)  # of the second pass in the first, at the same place
ASIDE = moved(0.25, 0.0, 0.3)  # slides along the wall


def statement(
    here: float, there: float, T: Array | None = None, odds: float = 100.0, sure: bool = True, session: int = 0
) -> Statement:
    """The camera of the second pass, ``here`` m on its way, in that of the first, ``there`` m on its way.

    Both look along z and go along x.
    """
    first = Standpoint(round(there * SECOND), 0, moved(there), there)
    second = Standpoint(round((100 + here) * SECOND), session, moved(here), 100.0 + here)
    at = (TRUE if T is None else T) @ moved(here - there)
    return Statement(second, first, at, odds, sure)


def heard(*statements: Statement) -> tuple[Consistency, list[int]]:
    consistency = Consistency()
    return consistency, [consistency.add(one) for one in statements]


def test_true_poses_of_neighbours_agree_and_support_each_other() -> None:
    consistency, numbers = heard(*(statement(x, x + 0.1) for x in (0.0, 0.2, 0.4)))
    for number in numbers:
        assert consistency.support(number).agreeing == 2
        assert consistency.support(number).share == pytest.approx(1.0)


def test_a_pose_that_slides_along_the_wall_has_no_share_among_true_ones() -> None:
    consistency, numbers = heard(*(statement(x, x + 0.1) for x in (0.0, 0.2, 0.4)), statement(0.6, 0.7, ASIDE))
    assert consistency.support(numbers[-1]).agreeing == 0 and consistency.support(numbers[-1]).share == 0.0
    assert consistency.support(numbers[0]).share == pytest.approx(2 / 3)


def test_what_is_unlikely_neither_supports_nor_weighs_much() -> None:
    doubtful = [statement(x, x + 0.1, odds=0.05, sure=False) for x in (0.2, 0.4)]
    consistency, numbers = heard(statement(0.0, 0.1), *doubtful)
    support = consistency.support(numbers[0])
    assert support.agreeing == 0 and support.heard < 0.1


def test_poses_of_one_keyframe_count_once() -> None:
    consistency, numbers = heard(statement(0.0, 0.1), statement(0.0, 0.3), statement(0.2, 0.1), statement(0.2, 0.3))
    assert [consistency.support(n).agreeing for n in numbers] == [1] * 4


def test_a_cluster_without_one_that_is_sure_supports_nothing() -> None:
    unsure = [statement(x, x + 0.1, odds=5.0, sure=False) for x in (0.0, 0.2, 0.4)]
    consistency, numbers = heard(*unsure)
    assert consistency.support(numbers[0]).agreeing == 0
    consistency.add(statement(0.6, 0.7))
    assert consistency.support(numbers[0]).agreeing == 3


def test_other_sessions_say_nothing_of_each_other() -> None:
    consistency, numbers = heard(statement(0.0, 0.1, session=1), statement(0.2, 0.3, session=2))
    assert numbers[0] not in consistency and consistency.support(numbers[1]).heard == 0.0


def test_what_is_beyond_reach_is_forgotten() -> None:
    consistency, (first, _) = heard(statement(0.0, 0.1), statement(REACH_M + 0.1, REACH_M + 0.2))
    assert first not in consistency and len(consistency) == 1


def test_a_camera_that_turns_on_the_spot_fills_no_memory() -> None:
    consistency = Consistency()
    for k in range(MOST + 20):
        last = consistency.add(statement(1e-4 * k, 1e-4 * k))
    assert len(consistency) == MOST and last in consistency


@pytest.mark.parametrize(("degrees", "agrees"), [(2.0, True), (5.0, False)])
def test_odometry_may_drift_by_some_degrees_over_a_metre(degrees: float, agrees: bool) -> None:
    turned = pose(rotation_from_vector(np.radians([0.0, degrees, 0.0])), np.zeros(3))
    one, other = statement(0.0, 0.0), statement(0.3, 0.3)
    other = other._replace(T_target_source=other.T_target_source @ turned)
    consistency, numbers = heard(one, other)
    assert (consistency.support(numbers[0]).share == 1.0) is agrees
