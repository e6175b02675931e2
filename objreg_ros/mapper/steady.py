# SPDX-License-Identifier: Apache-2.0
"""What is steadily wrong with odometry, told by the map: a heading that turns with the way, a scale, a mounting.

Unequal wheels, a camera that is calibrated a little wrong: most of what odometry gets wrong it gets wrong all along
(Borenstein and Feng, "Measurement and Correction of Systematic Odometry Errors in Mobile Robots", 1996). Closures that
bend the trajectory say so at every step, and what they say of all steps together also holds where nothing closes
(Kuemmerle, Grisetti, Burgard, "Simultaneous Calibration, Localization, and Mapping", 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, rotation_angle, rotation_from_vector, vector_from_rotation

UP = np.array([0.0, 0.0, 1.0])  # of the frame of odometry (REP-103)
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


class Steady(NamedTuple):
    """What has to be added to odometry with every metre: ``heading`` rad about up, m ``along`` and ``across`` it."""

    heading: float = 0.0
    along: float = 0.0
    across: float = 0.0


def step(T_odom_1: Array, T_odom_2: Array, steady: Steady) -> Array:
    """``T_1_2 (4, 4)`` of two poses of odometry, corrected."""
    way = T_odom_2[:3, 3] - T_odom_1[:3, 3]
    turned = steady.heading * float(np.linalg.norm(way)) * UP
    right = rotation_from_vector(0.5 * turned) @ ((1.0 + steady.along) * way + steady.across * (QUARTER_TURN @ way))
    R_1_odom = T_odom_1[:3, :3].T
    return pose(R_1_odom @ rotation_from_vector(turned) @ T_odom_2[:3, :3], R_1_odom @ right)


def estimate(
    T_odom_body: Sequence[Array], T_map_body: Sequence[Array], sigmas: tuple[float, float], expected: Steady
) -> Steady:
    """The steady part of how the map's steps differ from those of odometry, by weighted least squares.

    ``sigmas`` are odometry's wandering errors in m and rad after one metre or radian, growing with the root of the way;
    ``expected`` are the standard deviations of what is steady: 0 where nothing is, and nothing is estimated then.
    """
    spread = np.array(expected)
    information, total = np.eye(3), np.zeros(3)  # of the answer in units of what is expected
    for k in range(len(T_odom_body) - 1):
        motion = inverse(T_odom_body[k]) @ T_odom_body[k + 1]
        mapped = inverse(T_map_body[k]) @ T_map_body[k + 1]
        length = float(np.linalg.norm(motion[:3, 3])) + rotation_angle(motion[:3, :3])
        if length < 1e-6:
            continue
        error, A = _difference(T_odom_body[k][:3, :3], motion, mapped)
        weight = np.repeat(3.0 / (np.square(sigmas) * length), 3)[:, None]
        B = A * spread
        information += B.T @ (weight * B)
        total += B.T @ (weight[:, 0] * error)
    return Steady(*(spread * np.linalg.solve(information, total)).tolist())


def _difference(R_odom_1: Array, motion: Array, mapped: Array) -> tuple[Array, Array]:
    """How one step of the map differs from odometry's, [t r] in the axes of odometry, and how by each steady error."""
    shift = R_odom_1 @ (mapped[:3, 3] - motion[:3, 3])
    turn = R_odom_1 @ vector_from_rotation(mapped[:3, :3] @ motion[:3, :3].T)
    way = R_odom_1 @ motion[:3, 3]
    length = float(np.linalg.norm(way))
    A = np.zeros((6, 3))
    A[:3, 0], A[3:, 0] = 0.5 * length * (QUARTER_TURN @ way), length * UP
    A[:3, 1], A[:3, 2] = way, QUARTER_TURN @ way
    return np.concatenate([shift, turn]), A
