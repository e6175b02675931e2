# SPDX-License-Identifier: Apache-2.0
"""Odometry: exact without drift, and drifting by as much as it says with it."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error, rotation_angle
from objreg_tools.simulation.odometry import drifted, jittered, odometry_origin
from objreg_tools.simulation.params import OdometryParams
from objreg_tools.simulation.trajectory import Hand, Waypoint, carried

NONE = OdometryParams(distance_drift=0.0, turn_drift=0.0, tilt_error=0.0)


def straight(metres: float) -> np.ndarray:
    ends = [np.array([0.0, 0.0, 1.2]), np.array([metres, 0.0, 1.2])]
    way = [Waypoint(eye, eye + np.array([1.0, 0.0, -0.2])) for eye in ends]
    return carried(way, 40, 30.0, np.random.default_rng(0), Hand(tremor=0.0, shake=0.0))[0]


def test_without_drift_odometry_is_the_true_motion_in_a_frame_with_z_up() -> None:
    T_world_camera = straight(3.0)
    T_odom_camera, _ = drifted(T_world_camera, NONE, seed=1)
    T_world_odom = odometry_origin(T_world_camera[0])
    np.testing.assert_allclose(T_odom_camera, inverse(T_world_odom) @ T_world_camera, atol=1e-9)
    assert T_world_odom[2, 2] == 1.0 and T_odom_camera[0, 2, 3] == pytest.approx(1.2)


def test_position_drifts_by_the_stated_share_of_the_distance() -> None:
    truth = straight(1.0)
    params = OdometryParams(distance_drift=0.02, turn_drift=0.0, tilt_error=0.0)
    errors = [end_error(truth, params, seed)[1] for seed in range(200)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("metres", [1.0, 4.0])
def test_heading_drifts_by_the_stated_angle(metres: float) -> None:
    truth = straight(metres)
    params = OdometryParams(distance_drift=0.0, turn_drift=1.0, tilt_error=0.0)
    errors = [end_error(truth, params, seed)[0] for seed in range(200)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(0.9 * metres**2 + 0.1 * metres), rel=0.1)


def test_every_run_drifts_about_as_much() -> None:
    truth = straight(10.0)
    turned = [end_error(truth, OdometryParams(tilt_error=0.0), seed)[0] for seed in range(50)]
    assert min(turned) > 4.0 and max(turned) < 16.0


def test_the_tilt_error_does_not_grow() -> None:
    params = OdometryParams(distance_drift=0.0, turn_drift=0.0, tilt_error=0.5)
    truth = straight(20.0)
    errors = [end_error(truth, params, seed)[0] for seed in range(60)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(0.5 * np.sqrt(2), rel=0.3)


def test_covariances_are_positive_definite_and_grow() -> None:
    _, covariance = drifted(straight(5.0), OdometryParams(), seed=0)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert (np.diff(covariance[:, 0, 0]) >= 0).all()


def test_the_same_seed_drifts_the_same_way() -> None:
    truth = straight(2.0)
    first, again, other = (drifted(truth, OdometryParams(), seed)[0] for seed in (5, 5, 6))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert max(rotation_angle(a[:3, :3].T @ b[:3, :3]) for a, b in zip(first, truth, strict=True)) < np.pi


def test_jitter_errs_at_each_pose_for_itself_by_the_stated_size() -> None:
    truth = straight(2.0)
    params = NONE.replaced(turn_jitter=3.0, distance_jitter=0.04)
    (clean, _), (jittering, covariance) = (drifted(truth, of, seed=1) for of in (NONE, params))
    errors = np.array([pose_error(a, b) for a, b in zip(jittering, clean, strict=True)])
    assert np.sqrt(np.mean(errors**2, axis=0)) == pytest.approx([3.0, 4.0], rel=0.25)
    assert np.sqrt(np.trace(covariance[-1][:3, :3])) == pytest.approx(0.04, rel=0.01)


def test_jitter_leaves_the_drift_as_it_is() -> None:
    truth = straight(2.0)
    steady, _ = drifted(truth, OdometryParams(), seed=3)
    params = OdometryParams(turn_jitter=1.0, distance_jitter=0.01)
    assert np.array_equal(jittered(steady, params, 3), drifted(truth, params, 3)[0])
    assert jittered(steady, OdometryParams(), 3) is steady


def end_error(truth: np.ndarray, params: OdometryParams, seed: int) -> tuple[float, float]:
    """(degrees, cm) between the last pose by odometry and the true one."""
    T_odom_camera, _ = drifted(truth, params, seed)
    return pose_error(T_odom_camera[-1], inverse(odometry_origin(truth[0])) @ truth[-1])
