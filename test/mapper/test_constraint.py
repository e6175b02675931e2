# SPDX-License-Identifier: Apache-2.0
"""Frames and orders of a constraint, each against small motions made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.constraint import (
    Constraint,
    between_keyframes,
    compensated,
    floored,
    inverted,
    local_information,
    rotation_first,
    unseen,
    wandering,
)
from objreg_mapper.trajectory import Trajectory
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector, vector_from_rotation

RNG = np.random.default_rng(7)


def random_pose() -> Array:
    return pose(rotation_from_vector(RNG.normal(size=3)), RNG.normal(size=3))


def random_covariance() -> Array:
    A = 1e-3 * RNG.normal(size=(6, 6))
    return A @ A.T + 1e-8 * np.eye(6)


def disturbed(T: Array, error: Array) -> Array:
    """``T`` with the error [dt dr] of ROS."""
    return pose(rotation_from_vector(error[3:]) @ T[:3, :3], T[:3, 3] + error[:3])


def difference(T_disturbed: Array, T: Array) -> Array:
    """The error [dt dr] of ROS between two poses."""
    turn = vector_from_rotation(T_disturbed[:3, :3] @ T[:3, :3].T)
    return np.concatenate([T_disturbed[:3, 3] - T[:3, 3], turn])


def sampled_covariance(through: object, constraint: Constraint, local: bool = False) -> Array:
    """The covariance of ``through(T)`` by disturbing T along each eigenvector of its covariance."""
    values, vectors = np.linalg.eigh(constraint.covariance)
    total, step = np.zeros((6, 6)), 1e-5
    T_out = through(constraint.T_from_to)  # type: ignore[operator]
    for value, vector in zip(values, vectors.T, strict=True):
        T_moved = through(disturbed(constraint.T_from_to, step * vector))  # type: ignore[operator]
        if local:
            error = inverse(T_out) @ T_moved
            moved = np.concatenate([error[:3, 3], vector_from_rotation(error[:3, :3])]) / step
        else:
            moved = difference(T_moved, T_out) / step
        total += value * np.outer(moved, moved)
    return total


def test_compensation_carries_pose_and_covariance_to_the_keyframes() -> None:
    T_k1_from, T_to_k2 = random_pose(), random_pose()
    constraint = Constraint(random_pose(), random_covariance())
    moved = compensated(constraint, T_k1_from, T_to_k2)
    np.testing.assert_allclose(moved.T_from_to, T_k1_from @ constraint.T_from_to @ T_to_k2)
    expected = sampled_covariance(lambda T: T_k1_from @ T @ T_to_k2, constraint)
    np.testing.assert_allclose(moved.covariance, expected, rtol=1e-3, atol=1e-10)


def test_inverting_carries_the_covariance_and_twice_is_nothing() -> None:
    constraint = Constraint(random_pose(), random_covariance())
    back = inverted(constraint)
    np.testing.assert_allclose(back.T_from_to, inverse(constraint.T_from_to), atol=1e-12)
    np.testing.assert_allclose(back.covariance, sampled_covariance(inverse, constraint), rtol=1e-3, atol=1e-10)
    np.testing.assert_allclose(inverted(back).covariance, constraint.covariance, atol=1e-15)


def test_local_information_is_the_inverse_covariance_in_the_axes_of_to() -> None:
    constraint = Constraint(random_pose(), random_covariance())
    expected = sampled_covariance(lambda T: T, constraint, local=True)
    np.testing.assert_allclose(np.linalg.inv(local_information(constraint)), expected, rtol=1e-3, atol=1e-10)


def test_gtsam_wants_the_same_numbers_with_rotation_first() -> None:
    rng = np.random.default_rng(1)
    information, error = rng.normal(size=(6, 6)), rng.normal(size=6)
    swapped = np.concatenate([error[3:], error[:3]])
    assert swapped @ rotation_first(information) @ swapped == pytest.approx(error @ information @ error)


def test_a_closure_between_cameras_becomes_one_between_the_bodies_of_the_keyframes() -> None:
    T_body_camera = random_pose()
    T_world_body = {stamp: random_pose() for stamp in (0, 10, 20, 30)}
    odometry = Trajectory()
    for stamp, T in T_world_body.items():
        odometry.append(stamp, T)
    T_from_to = inverse(T_world_body[0] @ T_body_camera) @ T_world_body[20] @ T_body_camera
    closure = LoopClosure(from_ns=0, to_ns=20, T_from_to=T_from_to, covariance=np.eye(6), labels=())
    constraint = between_keyframes(closure, (odometry, odometry), (10, 30), T_body_camera)
    np.testing.assert_allclose(constraint.T_from_to, inverse(T_world_body[10]) @ T_world_body[30], atol=1e-9)


def test_a_closure_of_two_sessions_is_moved_by_the_odometry_of_each() -> None:
    T_body_camera, origin = random_pose(), random_pose()
    T_world_body = {stamp: random_pose() for stamp in (0, 10, 20, 30)}
    one, other = Trajectory(), Trajectory()
    for stamp, T in T_world_body.items():
        one.append(stamp, T) if stamp < 20 else other.append(stamp - 20, origin @ T)
    T_from_to = inverse(T_world_body[0] @ T_body_camera) @ T_world_body[20] @ T_body_camera
    closure = LoopClosure(from_ns=0, to_ns=0, T_from_to=T_from_to, covariance=np.eye(6), labels=())
    constraint = between_keyframes(closure, (one, other), (10, 10), T_body_camera)
    np.testing.assert_allclose(constraint.T_from_to, inverse(T_world_body[10]) @ T_world_body[30], atol=1e-9)


def test_a_closure_moved_by_odometry_is_known_less_well_by_what_that_wanders() -> None:
    sigmas = (0.02, 0.03)
    way = {0: (0.0, 0.0, 0.0), 1: (0.1, 0.0, 0.2), 20: (2.0, -0.5, 1.5), 22: (2.0, -0.3, 1.9)}  # x, y, turn about z
    T = {stamp: pose(rotation_from_vector(np.array([0, 0, yaw])), [x, y, 0.0]) for stamp, (x, y, yaw) in way.items()}
    T_body_camera = pose(rotation_from_vector(np.array([0.2, -0.5, 0.1])), np.array([0.3, 0.1, 0.15]))
    T_from_to = inverse(T[0] @ T_body_camera) @ T[20] @ T_body_camera
    closure = LoopClosure(from_ns=0, to_ns=20, T_from_to=T_from_to, covariance=1e-10 * np.eye(6), labels=())
    errors = []
    for _ in range(4000):
        odometry = Trajectory()
        for k1, k2 in ((0, 1), (20, 22)):
            step = inverse(T[k1]) @ T[k2]
            each = np.sqrt(np.diag(wandering(step, sigmas)))
            odometry.append(k1, T[k1])
            odometry.append(k2, T[k1] @ disturbed(step, each * RNG.standard_normal(6)))
        moved = between_keyframes(closure, (odometry, odometry), (1, 22), T_body_camera, sigmas)
        errors.append(difference(moved.T_from_to, inverse(T[1]) @ T[22]))
    seen, said = np.cov(np.array(errors).T), moved.covariance
    np.testing.assert_allclose(np.sqrt(np.diag(seen)), np.sqrt(np.diag(said)), rtol=0.15)
    spread = np.sqrt(np.outer(np.diag(said), np.diag(said)))
    np.testing.assert_allclose(seen / spread, said / spread, atol=0.15)


def test_odometry_wanders_with_metres_and_radians_alike() -> None:
    T = pose(rotation_from_vector(np.array([0.0, 0.3, 0.4])), np.array([0.0, 1.5, 2.0]))
    three_each = np.sqrt(np.diag(wandering(T, (0.02, 0.01)))).reshape(2, 3)
    assert np.linalg.norm(three_each, axis=1) == pytest.approx([0.02 * np.sqrt(3.0), 0.01 * np.sqrt(3.0)])


def test_in_a_silence_a_body_may_have_gone_as_far_as_it_gets_and_turned_any_way() -> None:
    assert np.sqrt(np.diag(unseen(4.0, 2.0))) == pytest.approx([8.0] * 3 + [np.pi] * 3)
    assert not unseen(0.0, 2.0).any()


def test_a_closure_outside_odometry_is_refused_with_the_span() -> None:
    odometry = Trajectory()
    odometry.append(5, np.eye(4))
    closure = LoopClosure(from_ns=0, to_ns=5, T_from_to=np.eye(4), covariance=np.eye(6), labels=())
    with pytest.raises(ValueError, match="expected a stamp within 5 to 5 ns, got 0 ns"):
        between_keyframes(closure, (odometry, odometry), (5, 5), np.eye(4))


def test_a_claim_is_raised_to_the_floor_in_the_directions_below_it_and_else_left_alone() -> None:
    honest = np.diag([1e-4] * 3 + [1e-4] * 3)
    assert floored(honest, (0.005, 0.001)) is honest
    bold = np.diag([1e-12, 1e-2, 1e-12, 1e-12, 1e-2, 1e-30])
    raised = np.diag([25e-6, 1e-2, 25e-6, 1e-6, 1e-2, 1e-6])
    np.testing.assert_allclose(floored(bold, (0.005, 0.001)), raised, atol=1e-15)
