# SPDX-License-Identifier: Apache-2.0
"""What is steadily wrong with odometry is found in the map, and nothing is where nothing is expected."""

from __future__ import annotations

import numpy as np
import pytest

from mapper.bent import square
from objreg_mapper.constraint import wandering
from objreg_mapper.optimisation.steady import Steady, corrected_steps, estimate
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector

TRUE = np.array(square(laps=2))
WRONG = Steady(heading=0.02, along=-0.015, across=0.01)
SIGMAS = (0.02, np.radians(1.0))


def chained(true: Array) -> Array:
    """The same poses, with all that is steadily wrong taken out of every step."""
    poses = [true[0]]
    for T_1_2 in corrected_steps(true, WRONG):
        poses.append(poses[-1] @ T_1_2)
    return np.array(poses)


def step(T_1: Array, T_2: Array, steady: Steady) -> Array:
    return corrected_steps(np.array([T_1, T_2]), steady)[0]


def found(T_odom_body: Array, T_map_body: Array, expected: Steady) -> Steady:
    """What the map says, were odometry to wander by `SIGMAS`."""
    steps = corrected_steps(T_odom_body, Steady())
    variances = np.array([np.diag(wandering(T, SIGMAS))[[0, 3]] for T in steps])
    return estimate(T_odom_body, T_map_body, variances, expected)


MAPPED = chained(TRUE)


@pytest.mark.parametrize("k", [0, 7, 40])
def test_a_step_without_anything_steady_is_that_of_odometry(k: int) -> None:
    assert pose_error(step(TRUE[k], TRUE[k + 1], Steady()), inverse(TRUE[k]) @ TRUE[k + 1]) == pytest.approx(
        (0.0, 0.0), abs=1e-6
    )


def test_heading_turns_about_up_with_the_way() -> None:
    T = step(TRUE[0], TRUE[1], Steady(heading=0.1))
    length = np.linalg.norm(TRUE[1][:3, 3] - TRUE[0][:3, 3])
    angle, _ = pose_error(T, inverse(TRUE[0]) @ TRUE[1])
    assert angle == pytest.approx(np.degrees(0.1 * length), rel=1e-4)


def test_a_way_that_turns_all_along_ends_where_half_of_the_turn_points() -> None:
    ahead = pose(np.eye(3), np.array([2.0, 0.0, 0.0]))
    T = step(np.eye(4), ahead, Steady(heading=0.1, along=0.05, across=0.02))
    np.testing.assert_allclose(T[:3, :3], rotation_from_vector(np.array([0.0, 0.0, 0.2])), atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], rotation_from_vector(np.array([0.0, 0.0, 0.1])) @ (2.1, 0.04, 0.0), atol=1e-12)


def test_what_goes_across_a_ramp_goes_level() -> None:
    T = step(np.eye(4), pose(np.eye(3), np.array([2.0, 0.0, 1.0])), Steady(across=0.1))
    np.testing.assert_allclose(T[:3, 3], (2.0, 0.2, 1.0), atol=1e-12)


@pytest.mark.parametrize("length", [0.5, 2.0])
def test_a_steady_error_is_believed_as_far_as_it_stands_out_of_what_wanders(length: float) -> None:
    ahead, farther = (pose(np.eye(3), np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]])) for x in (length, 1.05 * length))
    wander = SIGMAS[0] ** 2 * length / 3.0 / length**2  # of the step along the way, as a share of it
    along = found(ahead, farther, Steady(0.1, 0.01, 0.1)).along
    assert along == pytest.approx(0.05 * 0.01**2 / (0.01**2 + wander))


def test_a_steady_error_is_found() -> None:
    np.testing.assert_allclose(found(TRUE, MAPPED, Steady(0.1, 0.1, 0.1)), WRONG, atol=1e-3)


def test_what_is_not_expected_is_not_found() -> None:
    steady = found(TRUE, MAPPED, Steady(0.1, 0.0, 0.0))
    assert steady.along == 0.0 and steady.across == 0.0
    assert steady.heading == pytest.approx(WRONG.heading, abs=3e-3)


def test_a_map_that_is_odometry_says_nothing() -> None:
    np.testing.assert_allclose(found(TRUE, TRUE, Steady(0.1, 0.1, 0.1)), 0.0, atol=1e-9)


def test_long_steps_say_as_much_as_short_ones() -> None:
    true = np.array(square(laps=2, per_side=2))
    np.testing.assert_allclose(found(true, chained(true), Steady(0.1, 0.1, 0.1)), WRONG, atol=1e-3)


def test_a_rest_says_nothing_and_harms_nothing() -> None:
    again, expected = [*range(9), *range(8, len(TRUE))], Steady(0.1, 0.1, 0.1)
    np.testing.assert_allclose(found(TRUE[again], MAPPED[again], expected), found(TRUE, MAPPED, expected), atol=1e-12)


def test_one_pose_has_no_steps_and_says_nothing() -> None:
    assert corrected_steps(TRUE[:1], WRONG).shape == (0, 4, 4)
    assert estimate(TRUE[:1], TRUE[:1], np.zeros((0, 2)), Steady(0.1, 0.1, 0.1)) == Steady()
