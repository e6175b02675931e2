# SPDX-License-Identifier: Apache-2.0
"""What the surfaces hold badly, and what a systematic depth error makes of that."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import skew
from objreg_ros.registration.certainty.sandwich import systematic_depth_error_of_step
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.refine.batch_icp import Fit


def about_camera(H: Array, T_target_source: Array) -> Array:
    """The information of a left step [t r], which turns about the target camera, as that of the source camera's pose.

    ROS poses with covariance mean the latter: translation of the child's origin, rotation about it, fixed axes.
    """
    A = np.eye(6)
    A[:3, 3:] = skew(T_target_source[:3, 3])
    return np.asarray(A.T @ H @ A)


def systematic_depth_error(source: Prepared, target: Prepared, T_target_source: Array) -> Array:
    """The covariance (6, 6) [t r] of the source camera's pose by a systematic depth error, in the target's axes."""
    C = systematic_depth_error_of_step(
        source.xyz, source.normals, target.surface, T_target_source, (source.sight.noise, target.sight.noise)
    )
    A = np.eye(6)
    A[:3, 3:] = -skew(T_target_source[:3, 3])
    return np.asarray(A @ C @ A.T)


def degenerate_directions(found: Fit, T_target_source: Array, middle: Array, least_share: float) -> Array:
    """Unit directions (K, 6) [t r] of the source camera's pose that less than ``least_share`` of the surface resists.

    The motion is looked at about the ``middle (3,)`` of what was seen, with rotations scaled by its extent, so that a
    turn and a shift are comparable. A wall alone leaves three, a corridor one, a room none.
    """
    if found.inliers == 0:
        return np.eye(6)
    B = np.eye(6)  # from a step about the middle, rotation scaled, to a left step
    B[3:, 3:] /= found.extent
    B[:3, 3:] = skew(middle) / found.extent
    values, vectors = np.linalg.eigh(B.T @ found.H @ B / found.weight)
    degenerate = vectors[:, values < least_share]
    to_camera = np.eye(6)
    to_camera[:3, 3:] = -skew(T_target_source[:3, 3])
    directions = (to_camera @ B @ degenerate).T
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True)).reshape(-1, 6)
