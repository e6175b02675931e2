# SPDX-License-Identifier: Apache-2.0
"""Poses between two passes of a corridor, by an odometry that is right or drifts."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import SECOND, moved

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.keyframes.jitter import Jitter
from objreg_ros.registrar.consistency import MOST, REACH_M, Consistency, Standpoint, Statement, Support

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


def received(*statements: Statement) -> tuple[Consistency, list[int]]:
    consistency = Consistency()
    return consistency, [consistency.add_statement(one) for one in statements]


def test_true_poses_of_neighbours_agree_and_support_each_other() -> None:
    consistency, numbers = received(*(statement(x, x + 0.1) for x in (0.0, 0.2, 0.4)))
    for number in numbers:
        assert consistency.support(number).agreeing == 2
        assert consistency.support(number).share == pytest.approx(1.0)


def test_a_pose_that_slides_along_the_wall_has_no_share_among_true_ones() -> None:
    consistency, numbers = received(*(statement(x, x + 0.1) for x in (0.0, 0.2, 0.4)), statement(0.6, 0.7, ASIDE))
    assert consistency.support(numbers[-1]).agreeing == 0 and consistency.support(numbers[-1]).share == 0.0
    assert consistency.support(numbers[0]).share == pytest.approx(2 / 3)


def test_what_is_unlikely_neither_supports_nor_weighs_much() -> None:
    doubtful = [statement(x, x + 0.1, odds=0.05, sure=False) for x in (0.2, 0.4)]
    consistency, numbers = received(statement(0.0, 0.1), *doubtful)
    support = consistency.support(numbers[0])
    assert support.agreeing == 0 and support.received < 0.1


def test_poses_of_one_keyframe_count_once() -> None:
    consistency, numbers = received(statement(0.0, 0.1), statement(0.0, 0.3), statement(0.2, 0.1), statement(0.2, 0.3))
    assert [consistency.support(n).agreeing for n in numbers] == [1] * 4


def test_a_cluster_without_one_that_is_sure_supports_nothing() -> None:
    unsure = [statement(x, x + 0.1, odds=5.0, sure=False) for x in (0.0, 0.2, 0.4)]
    consistency, numbers = received(*unsure)
    assert consistency.support(numbers[0]).agreeing == 0
    consistency.add_statement(statement(0.6, 0.7))
    assert consistency.support(numbers[0]).agreeing == 3


def test_other_sessions_say_nothing_of_each_other() -> None:
    consistency, numbers = received(statement(0.0, 0.1, session=1), statement(0.2, 0.3, session=2))
    assert numbers[0] not in consistency and consistency.support(numbers[1]).received == 0.0


def test_what_is_beyond_reach_is_forgotten() -> None:
    consistency, (first, _) = received(statement(0.0, 0.1), statement(REACH_M + 0.1, REACH_M + 0.2))
    assert first not in consistency and len(consistency) == 1


def test_a_camera_that_turns_on_the_spot_fills_no_memory() -> None:
    consistency = Consistency()
    for k in range(MOST + 20):
        last = consistency.add_statement(statement(1e-4 * k, 1e-4 * k))
    assert len(consistency) == MOST and last in consistency


@pytest.mark.parametrize(("degrees", "agrees"), [(2.0, True), (5.0, False)])
def test_odometry_may_drift_by_some_degrees_over_a_metre(degrees: float, agrees: bool) -> None:
    turned = pose(rotation_from_vector(np.radians([0.0, degrees, 0.0])), np.zeros(3))
    one, other = statement(0.0, 0.0), statement(0.3, 0.3)
    other = other._replace(T_target_source=other.T_target_source @ turned)
    consistency, numbers = received(one, other)
    assert (consistency.support(numbers[0]).share == 1.0) is agrees


def turned(degrees: float, metres: float = 0.0) -> Array:
    return pose(rotation_from_vector(np.radians([0.0, degrees, 0.0])), np.array([metres, 0.0, 0.0]))


def random_pose(jitter: Jitter, rng: np.random.Generator) -> Array:
    """A small motion of that root mean square."""
    turn, shift = rng.standard_normal((2, 3)) / np.sqrt(3.0)
    return pose(rotation_from_vector(np.radians(jitter.rotation_deg) * turn), jitter.translation_m * shift)


def passes(jitter: Jitter, false: int = 0, seed: int = 0, by_odometry: bool = True) -> Consistency:
    """Two passes of 3 m with a sure pose each 5 cm, of 1 degree and 2 cm; ``false`` of ten slide along the wall."""
    rng, consistency = np.random.default_rng(seed), Consistency()
    for k in range(60):
        T = (ASIDE if k % 10 < false else TRUE) @ random_pose(Jitter(1.0, 0.02), rng)
        one = statement(0.05 * k, 0.05 * k, T)
        here, there = (
            end._replace(T_session_camera=end.T_session_camera @ random_pose(jitter, rng)) for end in one[:2]
        )
        consistency.add_statement(one._replace(source=here, target=there, by_odometry=by_odometry))
    return consistency


@pytest.mark.parametrize("jitter", [Jitter(3.0, 0.04), Jitter(2.0, 0.06), Jitter(6.0, 0.1)])
@pytest.mark.parametrize("seed", range(3))
def test_jitter_of_odometry_is_measured_from_sure_poses(jitter: Jitter, seed: int) -> None:
    assert passes(jitter, seed=seed).jitter == pytest.approx(jitter, rel=0.3)


def test_odometry_without_jitter_has_next_to_none() -> None:
    assert passes(Jitter(0.0, 0.0)).jitter == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("false", [1, 3])
def test_false_poses_do_not_move_the_measurement(false: int) -> None:
    assert passes(Jitter(0.0, 0.0), false).jitter == pytest.approx((0.0, 0.0), abs=1e-9)
    assert passes(Jitter(3.0, 0.04), false).jitter == pytest.approx((3.0, 0.04), rel=0.5)


def test_what_is_not_sure_or_by_our_own_tracking_measures_no_jitter() -> None:
    assert passes(Jitter(3.0, 0.04), by_odometry=False).jitter == (0.0, 0.0)
    unsure = [statement(0.05 * k, 0.05 * k, TRUE @ turned(5.0 * k), sure=False) for k in range(20)]
    assert received(*unsure)[0].jitter == (0.0, 0.0)


def support_of(T: Array, jitter: Jitter) -> Support:
    """What three true poses, farther on, say of a pose, once so much jitter was measured."""
    consistency = passes(jitter)
    for x in (10.0, 10.1, 10.2):
        consistency.add_statement(statement(x, x))
    return consistency.support(consistency.add_statement(statement(10.3, 10.3, T)))


def test_with_jitter_a_neighbour_2_degrees_beyond_the_tolerance_no_longer_opposes() -> None:
    off = TRUE @ turned(5.0)
    assert support_of(off, Jitter(0.0, 0.0)) == (0, 0.0, pytest.approx(3.0, abs=0.1))
    assert support_of(off, Jitter(3.0, 0.04)) == (0, 0.0, 0.0)


@pytest.mark.parametrize("metres", [0.4, -0.4, 0.8])
def test_with_jitter_what_moved_or_has_a_twin_40_cm_off_is_still_opposed(metres: float) -> None:
    for jitter in (Jitter(0.0, 0.0), Jitter(3.0, 0.04), Jitter(10.0, 0.3)):
        support = support_of(moved(metres) @ TRUE, jitter)
        assert support.received > 2.9 and support.share == 0.0


def test_jitter_lets_no_more_poses_agree() -> None:
    for off in (TRUE @ turned(4.0), TRUE @ turned(0.0, 0.1)):
        assert support_of(off, Jitter(6.0, 0.1)).agreeing == 0
    assert support_of(TRUE, Jitter(6.0, 0.1)).agreeing == 3
