# SPDX-License-Identifier: Apache-2.0
"""Gravity as all views of a session give it."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.keyframes.gravity_filter import ONE_VIEW, GravityFilter

DOWN = np.array([0.0, 0.0, -1.0])  # in the frame of the session


def line() -> GravityFilter:
    return GravityFilter(metres=2.0, degrees=120.0)


def taught(turns: int) -> GravityFilter:
    """One that views around have given gravity, each turned by 10 degrees more."""
    gravity_filter = line()
    for k in range(turns):
        T = camera(10.0 * k)
        gravity_filter.update(T, T[:3, :3].T @ DOWN, 1.0)
    return gravity_filter


def camera(yaw_deg: float, x: float = 0.0) -> np.ndarray:
    return pose(rotation_from_vector(np.radians([-100.0, 0.0, 0.0])) @ turn(yaw_deg), np.array([x, 0.0, 1.0]))


def turn(yaw_deg: float) -> np.ndarray:
    return rotation_from_vector(np.radians([0.0, yaw_deg, 0.0]))


def error_deg(found: np.ndarray, T_session_camera: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(T_session_camera[:3, :3] @ found @ DOWN, -1.0, 1.0))))


def test_a_first_view_is_taken_as_it_is_and_counts_little() -> None:
    T = camera(0.0)
    found, weight = line().update(T, T[:3, :3].T @ DOWN, 1.0)
    assert found is not None and error_deg(found, T) < 1e-6
    assert weight == pytest.approx(ONE_VIEW)


def test_views_from_around_that_err_each_its_own_way_together_err_less_and_count_more() -> None:
    rng, gravity_filter, errors, alone = np.random.default_rng(0), line(), [], []
    for k in range(60):
        T = camera(6.0 * k, 0.1 * k)
        measured = rotation_from_vector(np.radians(1.0) * rng.standard_normal(3)) @ T[:3, :3].T @ DOWN
        found, weight = gravity_filter.update(T, measured, 1.0)
        assert found is not None
        errors.append(error_deg(found, T))
        alone.append(error_deg(measured, T))
    assert np.mean(errors[30:]) < 0.5 * np.mean(alone[30:])
    assert 0.8 < weight <= 1.0


def test_a_camera_that_rests_learns_nothing() -> None:
    gravity_filter, T = line(), camera(0.0)
    weights = [gravity_filter.update(T, T[:3, :3].T @ DOWN, 1.0)[1] for _ in range(50)]
    np.testing.assert_allclose(weights, ONE_VIEW)


def test_a_camera_that_rests_learns_nothing_however_its_odometry_jitters() -> None:
    rng, gravity_filter, weights = np.random.default_rng(0), line(), []
    for _ in range(2000):
        T = camera(0.05 * rng.standard_normal(), 5e-4 * rng.standard_normal())
        weights.append(gravity_filter.update(T, T[:3, :3].T @ DOWN, 1.0)[1])
    np.testing.assert_allclose(weights, ONE_VIEW)


def test_a_camera_that_creeps_learns_as_one_that_strides() -> None:
    creeping, striding = line(), line()
    for k in range(1001):
        T = camera(0.1 * k)
        slow = creeping.update(T, T[:3, :3].T @ DOWN, 1.0)[1]
    for k in range(11):
        T = camera(10.0 * k)
        fast = striding.update(T, T[:3, :3].T @ DOWN, 1.0)[1]
    assert slow == pytest.approx(fast, abs=0.02)


def test_what_is_forgotten_is_not_carried_on() -> None:
    gravity_filter, T = taught(20), camera(200.0)
    gravity_filter.reset()
    assert gravity_filter.update(T, T[:3, :3].T @ DOWN, 1.0)[1] == pytest.approx(ONE_VIEW)
    assert taught(20).update(T, T[:3, :3].T @ DOWN, 1.0)[1] > 0.5


def test_a_view_without_gravity_gets_that_of_those_before_it() -> None:
    gravity_filter, T = taught(10), camera(110.0)
    found, weight = gravity_filter.update(T, None, 0.0)
    assert found is not None and error_deg(found, T) < 1e-6
    assert 0.0 < weight < 1.0


def test_nothing_is_known_before_a_view_gave_it() -> None:
    assert line().update(camera(0.0), None, 0.0) == (None, 0.0)


def test_a_doubtful_view_hardly_counts() -> None:
    gravity_filter, T = taught(20), camera(210.0)
    found, _ = gravity_filter.update(T, rotation_from_vector(np.radians([5.0, 0.0, 0.0])) @ T[:3, :3].T @ DOWN, 0.4)
    assert found is not None and error_deg(found, T) < 0.1


def test_old_views_are_forgotten_as_odometry_may_tilt() -> None:
    gravity_filter, tilt = line(), rotation_from_vector(np.radians([0.0, 8.0, 0.0]))
    for k in range(20):
        T = camera(0.0, 0.1 * k)
        gravity_filter.update(T, T[:3, :3].T @ DOWN, 1.0)
    for k in range(20, 120):
        T = camera(0.0, 0.1 * k)
        found, _ = gravity_filter.update(T, T[:3, :3].T @ tilt @ DOWN, 1.0)
    assert found is not None
    assert error_deg(found, T) == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize("there", [camera(0.0, 2.0), camera(120.0), camera(60.0, 1.0)], ids=["gone", "turned", "both"])
def test_two_metres_or_a_hundred_and_twenty_degrees_are_as_much_of_a_way(there: np.ndarray) -> None:
    gravity_filter, start = line(), camera(0.0)
    gravity_filter.update(start, start[:3, :3].T @ DOWN, 1.0)
    _, weight = gravity_filter.update(there, there[:3, :3].T @ DOWN, 1.0)
    assert weight == pytest.approx(1.0 - np.exp(-1.0) + ONE_VIEW)
