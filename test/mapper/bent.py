# SPDX-License-Identifier: Apache-2.0
"""A walk around a square whose odometry bends it, with closures that are known exactly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse, pose, rotation_from_vector

SECOND = 1_000_000_000


def step(x: float = 0.0, yaw: float = 0.0) -> Array:
    """Ahead by ``x`` m, then left by ``yaw`` rad."""
    return pose(rotation_from_vector(np.array([0.0, 0.0, yaw])), np.array([x, 0.0, 0.0]))


def square(side: float = 2.0, per_side: int = 20, laps: int = 1) -> list[Array]:
    """True poses around a square and back to its start."""
    poses = [np.eye(4)]
    for _ in range(4 * laps):
        poses += [poses[-1] @ step(x=side / per_side * k) for k in range(1, per_side + 1)]
        poses[-1] = poses[-1] @ step(yaw=np.pi / 2)
    return poses


def bent(true: list[Array]) -> list[Array]:
    """The same walk as odometry has it: a little too long, and turning."""
    poses = [true[0]]
    for before, after in pairwise(true):
        motion = inverse(before) @ after
        motion[:3, 3] *= 1.02
        poses.append(poses[-1] @ motion @ step(yaw=np.radians(0.15)))
    return poses


def odometry(poses: list[Array]) -> list[Odometry]:
    """One pose every tenth of a second."""
    return [Odometry(T_odom_body=T, stamp_ns=k * SECOND // 10) for k, T in enumerate(poses)]


def closure(true: list[Array], a: int, b: int, error: Array | None = None) -> LoopClosure:
    """What a perfect registrar says of the steps ``a`` and ``b``, or one that is off by ``error`` (4, 4)."""
    T_from_to = inverse(true[a]) @ true[b] @ (np.eye(4) if error is None else error)
    covariance = np.diag([0.02**2] * 3 + [np.radians(0.5) ** 2] * 3)
    moments = {"from_ns": a * SECOND // 10, "to_ns": b * SECOND // 10}
    return LoopClosure(T_from_to=T_from_to, covariance=covariance, labels=("cup",), **moments)


def distances(poses: list[Array], true: list[Array]) -> Array:
    """How far each pose is from the truth, m."""
    return np.array([np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in zip(poses, true, strict=True)])
