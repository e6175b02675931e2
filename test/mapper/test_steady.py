# SPDX-License-Identifier: Apache-2.0
"""What is steadily wrong with odometry is found in the map, and nothing is where nothing is expected."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.mapper.steady import Steady, estimate, step

from .bent import square

TRUE = square(laps=2)
WRONG = Steady(heading=0.02, along=-0.015, across=0.01)
SIGMAS = (0.02, np.radians(1.0))


def chained(steps: list[Array]) -> list[Array]:
    poses = [TRUE[0]]
    for T_1_2 in steps:
        poses.append(poses[-1] @ T_1_2)
    return poses


MAPPED = chained([step(a, b, WRONG) for a, b in pairwise(TRUE)])


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
    ahead, farther = (pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in (length, 1.05 * length))
    found = estimate([np.eye(4), ahead], [np.eye(4), farther], SIGMAS, Steady(0.1, 0.01, 0.1))
    wandering = SIGMAS[0] ** 2 * length / 3.0 / length**2  # of the step along the way, as a share of it
    assert found.along == pytest.approx(0.05 * 0.01**2 / (0.01**2 + wandering))


def test_a_steady_error_is_found() -> None:
    found = estimate(TRUE, MAPPED, SIGMAS, Steady(0.1, 0.1, 0.1))
    np.testing.assert_allclose(found, WRONG, atol=1e-3)


def test_what_is_not_expected_is_not_found() -> None:
    found = estimate(TRUE, MAPPED, SIGMAS, Steady(0.1, 0.0, 0.0))
    assert found.along == 0.0 and found.across == 0.0
    assert found.heading == pytest.approx(WRONG.heading, abs=3e-3)


def test_a_map_that_is_odometry_tells_nothing() -> None:
    np.testing.assert_allclose(estimate(TRUE, TRUE, SIGMAS, Steady(0.1, 0.1, 0.1)), 0.0, atol=1e-9)


def test_long_steps_tell_as_much_as_short_ones() -> None:
    true = square(laps=2, per_side=2)
    mapped = [true[0]]
    for a, b in pairwise(true):
        mapped.append(mapped[-1] @ step(a, b, WRONG))
    np.testing.assert_allclose(estimate(true, mapped, SIGMAS, Steady(0.1, 0.1, 0.1)), WRONG, atol=1e-3)


def test_a_rest_tells_nothing_and_harms_nothing() -> None:
    rested = ([poses[k] for k in (*range(9), *range(8, len(TRUE)))] for poses in (TRUE, MAPPED))
    found = estimate(*rested, SIGMAS, Steady(0.1, 0.1, 0.1))
    np.testing.assert_allclose(found, estimate(TRUE, MAPPED, SIGMAS, Steady(0.1, 0.1, 0.1)), atol=1e-12)
