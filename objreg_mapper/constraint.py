# SPDX-License-Identifier: Apache-2.0
"""A constraint moved to where a consumer needs it: to its own keyframes, and into its own order of six numbers.

`LoopClosure.covariance` follows ROS: the error ``[dt dr]`` with ``t' = t + dt`` and ``R' = exp(dr) R``, in the axes of
the *from* frame. What a consumer wants differs in three ways, and each of them has a function here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from objreg_mapper.trajectory import Trajectory
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_angle, skew


class Constraint(NamedTuple):
    """``T_from_to (4, 4)`` and its ``covariance (6, 6)`` in ROS order, in the *from* frame."""

    T_from_to: Array
    covariance: Array


EXACT = (0.0, 0.0)
NEAR_HALF_TURN = -0.9  # the cosine of the angle


def between_keyframes(
    closure: LoopClosure,
    odometry: tuple[Trajectory, Trajectory],
    keyframes_ns: tuple[int, int],
    T_body_camera: Array | tuple[Array, Array],
    sigmas: tuple[float, float] = EXACT,
) -> Constraint:
    """The closure as a constraint between the bodies at a consumer's own keyframes, near *from* and near *to*.

    ``T_k1_k2 = O(k1)^-1 O(from) T_from_to O(to)^-1 O(k2)`` with O the odometry of the camera at the closure's stamps
    and of the body at the keyframes; that of *from* and that of *to*, which may be two sessions, or of two robots with
    two cameras on them. ``sigmas`` m and rad are how it wanders over one metre or one radian: a closure is known less
    well where it was not measured. ValueError for a stamp that odometry does not cover.
    """
    (of_from, of_to), (k1_ns, k2_ns) = odometry, keyframes_ns
    T_k1_body = inverse(of_from.at(k1_ns)) @ of_from.at(closure.from_ns)  # at the closure's stamps
    T_k2_body = inverse(of_to.at(k2_ns)) @ of_to.at(closure.to_ns)
    measured = Constraint(closure.T_from_to, closure.covariance)
    T_body_from, T_body_to = T_body_camera if isinstance(T_body_camera, tuple) else (T_body_camera, T_body_camera)
    moved = compensated(measured, T_k1_body @ T_body_from, inverse(T_k2_body @ T_body_to))
    turned = _turning(moved.T_from_to[:3, 3] - T_k1_body[:3, 3])
    there, back = wandering(T_k1_body, sigmas), wandering(T_k2_body, sigmas)
    return moved._replace(covariance=moved.covariance + turned @ there @ turned.T + back)


def rotation_vectors(R: Array) -> Array:
    """(m, 3) of rotations (m, 3, 3): the axis is that of their skew part, which near half a turn has none."""
    axis = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine, cosine = np.linalg.norm(axis, axis=1), 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    angle_by_sine = np.divide(np.arctan2(sine, cosine), sine, out=np.ones_like(sine), where=sine > 0.0)
    vectors = axis * angle_by_sine[:, None]
    turned = cosine < NEAR_HALF_TURN
    if turned.any():
        vectors[turned] = Rotation.from_matrix(R[turned]).as_rotvec()
    return vectors


def wandering(T_motion: Array, sigmas: tuple[float, float]) -> Array:
    """The covariance (6, 6) of a motion by odometry whose errors, in m and rad, grow with the root of the path."""
    path = float(np.linalg.norm(T_motion[:3, 3])) + rotation_angle(T_motion[:3, :3])
    return np.diag(path * np.repeat(np.square(sigmas) / 3, 3))


def floored(covariance: Array, sigmas: tuple[float, float]) -> Array:
    """The covariance (6, 6), raised in every direction in which it claims less than ``sigmas`` m and rad."""
    least = np.repeat(sigmas, 3)
    spread = np.outer(least, least)
    values, vectors = np.linalg.eigh(covariance / spread)
    if values.min() >= 1.0:
        return covariance
    return spread * ((vectors * np.maximum(values, 1.0)) @ vectors.T)


def freed(constraint: Constraint, sigmas: tuple[float, float], ends: tuple[bool, bool] = (True, True)) -> Constraint:
    """The constraint between keyframes whose pictures are off by so many m and rad, at these ends of it."""
    spread, R = np.diag(np.repeat(np.square(sigmas), 3)), np.kron(np.eye(2), constraint.T_from_to[:3, :3])
    turned, C = _turning(constraint.T_from_to[:3, 3]), constraint.covariance
    C = C + turned @ spread @ turned.T if ends[0] else C
    return constraint._replace(covariance=C + R @ spread @ R.T if ends[1] else C)


def unseen(seconds: float, max_speed: float) -> Array:
    """The covariance (6, 6) of a motion that was not reported for so long: to anywhere that a body gets, any turn.

    Odometry that is silent for a while may have begun anew meanwhile.
    """
    turn = np.pi if seconds > 0.0 else 0.0
    return np.diag(np.square(np.repeat([max_speed * seconds, turn], 3)))


def _turning(lever: Array) -> Array:
    """What an error [t r] of a pose makes of one that follows it at ``lever (3,)`` m."""
    J = np.eye(6)
    J[:3, 3:] = -skew(lever)
    return J


def compensated(constraint: Constraint, T_k1_from: Array, T_to_k2: Array) -> Constraint:
    """``T_k1_k2 = T_k1_from T_from_to T_to_k2`` and its covariance, to first order.

    The two outer poses count as exact.
    """
    R_k1_from = T_k1_from[:3, :3]
    lever = constraint.T_from_to[:3, :3] @ T_to_k2[:3, 3]
    J = np.zeros((6, 6))
    J[:3, :3] = J[3:, 3:] = R_k1_from
    J[:3, 3:] = -R_k1_from @ skew(lever)
    return Constraint(T_k1_from @ constraint.T_from_to @ T_to_k2, J @ constraint.covariance @ J.T)


def inverted(constraint: Constraint) -> Constraint:
    """The same constraint from *to* to *from*: ``T_to_from`` and the covariance in the *to* frame."""
    R, t = constraint.T_from_to[:3, :3], constraint.T_from_to[:3, 3]
    J = np.zeros((6, 6))
    J[:3, :3] = J[3:, 3:] = -R.T
    J[:3, 3:] = -R.T @ skew(t)
    return Constraint(pose(R.T, -R.T @ t), J @ constraint.covariance @ J.T)


def local_covariance(constraint: Constraint) -> Array:
    """The (6, 6) covariance of the error ``[t r]`` in the axes of the *to* frame: ``T' = T exp([t r])``.

    This is what pose-graph optimisers weigh (g2o's EdgeSE3, GTSAM's BetweenFactor, and RTAB-Map over them): the error
    of ``measured^-1 estimated``.
    """
    J = np.kron(np.eye(2), constraint.T_from_to[:3, :3].T)
    return J @ constraint.covariance @ J.T


def local_information(constraint: Constraint) -> Array:
    """The inverse of `local_covariance`."""
    information = np.linalg.inv(local_covariance(constraint))
    return (information + information.T) / 2


def rotation_first(matrix: Array) -> Array:
    """A (6, 6) of the error [t r], ROS's order, as one of [r t], GTSAM's."""
    return np.roll(matrix, 3, axis=(0, 1))
