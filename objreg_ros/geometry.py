# SPDX-License-Identifier: Apache-2.0
"""Rigid motions and the pinhole camera, for more than one package.

A pose ``T_a_b`` is a (4, 4) float64 matrix that maps points of frame b into frame a: ``p_a = T_a_b @ p_b``.
Tangent vectors follow ROS (REP-103): translation first, ``[tx ty tz rx ry rz]``, metres and radians.
Camera frames are optical: x right, y down, z forward.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

AGAIN_S = 1.0  # no odometry is back sooner when what makes it is started again,
SAME_POSE = 1e-4  # and then it is where it first was, to this: m, rad


def inverse(T_a_b: Array) -> Array:
    """The inverse motion ``T_b_a`` of a rigid (4, 4) ``T_a_b``."""
    T_b_a = np.eye(4)
    T_b_a[:3, :3] = T_a_b[:3, :3].T
    T_b_a[:3, 3] = -T_b_a[:3, :3] @ T_a_b[:3, 3]
    return T_b_a


def inverses(T: Array) -> Array:
    """The inverse motions of poses (K, 4, 4)."""
    out = np.zeros_like(T)
    out[:, :3, :3] = T[:, :3, :3].transpose(0, 2, 1)
    out[:, :3, 3] = -np.einsum("kij,kj->ki", out[:, :3, :3], T[:, :3, 3])
    out[:, 3, 3] = 1.0
    return out


def transform(T_a_b: Array, points_b: Array) -> Array:
    """Points (..., 3) of frame b in frame a; the dtype of the points is kept."""
    R, t = T_a_b[:3, :3].astype(points_b.dtype), T_a_b[:3, 3].astype(points_b.dtype)
    return points_b @ R.T + t


def rotate(T_a_b: Array, vectors_b: Array) -> Array:
    """Directions (..., 3) of frame b in frame a; the dtype of the vectors is kept."""
    return vectors_b @ T_a_b[:3, :3].T.astype(vectors_b.dtype)


def pose(R: Array, t: Array) -> Array:
    """The poses (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3), which broadcast."""
    T = np.zeros((*np.broadcast_shapes(np.shape(R)[:-2], np.shape(t)[:-1]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, t, 1.0
    return T


def mounting(numbers: Sequence[float], name: str = "T_base_camera") -> Array | None:
    """The pose (4, 4) of ``x y z qx qy qz qw``, None of no numbers: one is where the other is.

    ``name`` is that of the parameter. ValueError for any other count and for a quaternion of length 0.
    """
    if not numbers:
        return None
    if len(numbers) != 7:
        raise ValueError(f"{name}: expected x y z qx qy qz qw or nothing, got {tuple(numbers)}")
    return pose(rotation_from_quaternion(np.array(numbers[3:])), np.array(numbers[:3], float))


def is_rigid(T: Array, tolerance: float = 1e-5) -> bool:
    """Whether ``T`` is a finite (4, 4) with an orthonormal, right-handed rotation and the last row 0 0 0 1."""
    if T.shape != (4, 4) or not np.isfinite(T).all() or not np.array_equal(T[3], (0, 0, 0, 1)):
        return False
    R = T[:3, :3]
    return bool(np.abs(R @ R.T - np.eye(3)).max() < tolerance and np.linalg.det(R) > 0)


def rigid(T: Array) -> Array:
    """A pose (4, 4) with its rotation made orthonormal again: each product leaves it a little less so."""
    return pose(rotation_from_vector(vector_from_rotation(T[:3, :3])), T[:3, 3])


def skew(v: Array) -> Array:
    """The cross-product matrices (..., 3, 3) of vectors (..., 3): ``skew(v) @ w == cross(v, w)``."""
    K = np.zeros((*np.shape(v), 3))
    x, y, z = np.moveaxis(v, -1, 0)
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -z, y, -x
    K[..., 1, 0], K[..., 2, 0], K[..., 2, 1] = z, -y, x
    return K


def rotation_from_vector(rotation_vector: Array) -> Array:
    """Rodrigues' formula: the rotations (..., 3, 3) about axes (..., 3) by their lengths in radians."""
    vector = np.asarray(rotation_vector, float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    K = skew(vector) / np.maximum(angle, np.finfo(float).tiny)
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))


def vector_from_rotation(R: Array) -> Array:
    """The (3,) rotation vector of a (3, 3) rotation, of length 0 to pi; the inverse of Rodrigues' formula."""
    x, y, z, w = quaternion_from_rotation(R)
    axis = np.array([x, y, z]) * (1.0 if w >= 0 else -1.0)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return 2.0 * axis
    return axis / sine * (2.0 * np.arctan2(sine, abs(w)))


def quaternion_from_rotation(R: Array) -> Array:
    """The unit quaternion (x, y, z, w) of a (3, 3) rotation, stable for every angle.

    Eigenvector form of Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix" (2000).
    """
    xx, yx, zx, xy, yy, zy, xz, yz, zz = (float(v) for v in R.T.flat)
    N = np.array(
        [
            [xx - yy - zz, 0.0, 0.0, 0.0],
            [yx + xy, yy - xx - zz, 0.0, 0.0],
            [zx + xz, zy + yz, zz - xx - yy, 0.0],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    q = np.linalg.eigh(N / 3.0)[1][:, -1]
    return q if q[3] >= 0 else -q


def rotation_from_quaternion(xyzw: Array) -> Array:
    """The (3, 3) rotation of a quaternion (x, y, z, w) of any non-zero length; ValueError if it has none."""
    q = np.asarray(xyzw, float)
    norm = float(np.linalg.norm(q))
    if not np.isfinite(norm) or norm < 1e-9:
        raise ValueError(f"expected a quaternion of non-zero length, got {q.tolist()}")
    x, y, z, w = q / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_angle(R: Array) -> float:
    """The angle of a (3, 3) rotation in radians, 0 to pi; exact for small angles too."""
    return float(np.linalg.norm(vector_from_rotation(R)))


def pose_error(T_estimated: Array, T_true: Array) -> tuple[float, float]:
    """(rotation in degrees, distance in centimetres) between two poses of the same frames."""
    rotation = np.degrees(rotation_angle(T_true[:3, :3].T @ T_estimated[:3, :3]))
    return float(rotation), float(100.0 * np.linalg.norm(T_estimated[:3, 3] - T_true[:3, 3]))


def turned_about(covariance: Array, lever: Array) -> Array:
    """The covariance (6, 6) [tx ty tz rx ry rz] of a point that is ``lever (3,)`` away on the same rigid body.

    Both in the same fixed axes: what the rotation is unsure of moves the point.
    """
    J = np.eye(6)
    J[:3, 3:] = -skew(lever)
    return np.asarray(J @ covariance @ J.T)


def leaps(T_odom_before: Array, T_odom_after: Array, seconds: float, max_speed: float, T_odom_first: Array) -> bool:
    """Whether odometry has begun anew between two poses (4, 4): no body moves so within that time.

    Faster than ``max_speed`` m/s, or two turns a second, with half a metre and 20 degrees to spare for what a filter
    puts right at once. Nor, however long nothing came, from somewhere else to exactly ``T_odom_first``, where it began.
    """
    if seconds > AGAIN_S and np.allclose(T_odom_after, T_odom_first, rtol=0.0, atol=SAME_POSE):
        seconds = 0.0
    T_before_after = inverse(T_odom_before) @ T_odom_after
    turned = np.degrees(rotation_angle(T_before_after[:3, :3]))
    return bool(np.linalg.norm(T_before_after[:3, 3]) > 0.5 + max_speed * seconds or turned > 20.0 + 720.0 * seconds)


def rotation_between(source: Array, target: Array) -> Array:
    """The shortest (3, 3) rotation that turns the direction ``source`` (3,) into ``target`` (3,)."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    cosine = float(a @ b)
    if cosine < -1.0 + 1e-9:  # opposite: half a turn about any axis at a right angle to a
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return rotation_from_vector(np.pi * axis / np.linalg.norm(axis))
    K = skew(np.cross(a, b))
    return np.eye(3) + K + K @ K / (1.0 + cosine)


def rigid_fit(source: Array, target: Array) -> Array:
    """``T_target_source (4, 4)`` that brings points (N, 3) closest to their partners, in the sum of squares.

    Never a mirror (Umeyama, 1991). ValueError without any points, and for unequal numbers of them.
    """
    if len(source) == 0 or source.shape != target.shape:
        raise ValueError(f"expected as many points as partners, at least 1, got {source.shape} and {target.shape}")
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - middle_target).T @ (source - middle_source))
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return pose(R, middle_target - R @ middle_source)


def interpolate(T_a: Array, T_b: Array, fraction: float) -> Array:
    """The pose at ``fraction`` 0..1 from ``T_a`` to ``T_b``: linear in position, shortest arc in rotation."""
    R = T_a[:3, :3] @ rotation_from_vector(fraction * vector_from_rotation(T_a[:3, :3].T @ T_b[:3, :3]))
    return pose(R, (1.0 - fraction) * T_a[:3, 3] + fraction * T_b[:3, 3])


def back_project(depth: Array, fx: float, fy: float, cx: float, cy: float) -> Array:
    """(H, W) depth in metres to (H, W, 3) points of the optical frame; the dtype of the depth is kept."""
    height, width = depth.shape
    x = ((np.arange(width) - cx) / fx).astype(depth.dtype)
    y = ((np.arange(height) - cy) / fy).astype(depth.dtype)
    return np.stack([x[None, :] * depth, y[:, None] * depth, depth], axis=-1)
