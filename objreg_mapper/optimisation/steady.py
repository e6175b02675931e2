# SPDX-License-Identifier: Apache-2.0
"""What is steadily wrong with odometry, found by the map: a heading that turns with the path, a scale, a mounting.

Unequal wheels, a camera that is calibrated a little wrong: most of what odometry gets wrong it gets wrong all along
(Borenstein and Feng, "Measurement and Correction of Systematic Odometry Errors in Mobile Robots", 1996). Closures that
bend the trajectory say so at every step, and what they say of all steps together also holds where nothing closes
(Kuemmerle, Grisetti, Burgard, "Simultaneous Calibration, Localization, and Mapping", 2011).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_mapper.constraint import rotation_vectors
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses, rotation_from_vector

UP = np.array([0.0, 0.0, 1.0])  # of the frame of odometry (REP-103)
LEAST_VARIANCE = 1e-12  # m^2 and rad^2 of a step: one at rest adds nothing, and does not divide by nothing
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


class Steady(NamedTuple):
    """What has to be added to odometry with every metre: ``heading`` rad about up, m ``along`` and ``across`` it."""

    heading: float = 0.0
    along: float = 0.0
    across: float = 0.0


def corrected_steps(T_odom_body: Array, steady: Steady) -> Array:
    """``T_1_2 (n - 1, 4, 4)`` from each of n poses of odometry to the next, corrected."""
    first, second = T_odom_body[:-1], T_odom_body[1:]
    steps_m = second[:, :3, 3] - first[:, :3, 3]
    turns = steady.heading * np.linalg.norm(steps_m, axis=1)[:, None] * UP
    stretched = (1.0 + steady.along) * steps_m + steady.across * steps_m @ QUARTER_TURN.T
    R_1_odom = first[:, :3, :3].transpose(0, 2, 1)
    T = np.tile(np.eye(4), (len(steps_m), 1, 1))
    T[:, :3, :3] = R_1_odom @ rotation_from_vector(turns) @ second[:, :3, :3]
    T[:, :3, 3] = np.einsum("mij,mjk,mk->mi", R_1_odom, rotation_from_vector(0.5 * turns), stretched)
    return T


def estimate(T_odom_body: Array, T_map_body: Array, variances: Array, expected: Steady) -> Steady:
    """The steady part of how the map's steps differ from those of odometry, by weighted least squares.

    Of n poses (n, 4, 4) in both; ``variances (n - 1, 2)`` of each step's position and rotation, m^2 and rad^2 in every
    axis. ``expected`` are the standard deviations of what is steady: 0 where nothing is, and nothing is estimated then.
    """
    spread = np.array(expected)
    errors, A = _differences(T_odom_body, T_map_body)
    weights = np.repeat(1.0 / np.maximum(variances, LEAST_VARIANCE), 3, axis=1)
    B = A * spread  # the answer is in units of what is expected
    information = np.eye(3) + np.einsum("mij,mi,mik->jk", B, weights, B)
    total = np.einsum("mij,mi,mi->j", B, weights, errors)
    return Steady(*(spread * np.linalg.solve(information, total)).tolist())


def _differences(T_odom_body: Array, T_map_body: Array) -> tuple[Array, Array]:
    """How steps of the map differ from odometry's, [t r] (m, 6) in the axes of odometry, and how by what is steady."""
    R_odom_1 = T_odom_body[:-1, :3, :3]
    motion, mapped = (inverses(T[:-1]) @ T[1:] for T in (T_odom_body, T_map_body))
    shifts = np.einsum("mij,mj->mi", R_odom_1, mapped[:, :3, 3] - motion[:, :3, 3])
    turns = rotation_vectors(mapped[:, :3, :3] @ motion[:, :3, :3].transpose(0, 2, 1))
    steps_m = T_odom_body[1:, :3, 3] - T_odom_body[:-1, :3, 3]
    lengths, left = np.linalg.norm(steps_m, axis=1)[:, None], steps_m @ QUARTER_TURN.T
    A = np.zeros((len(steps_m), 6, 3))
    A[:, :3, 0], A[:, 3:, 0] = 0.5 * lengths * left, lengths * UP
    A[:, :3, 1], A[:, :3, 2] = steps_m, left
    return np.hstack([shifts, np.einsum("mij,mj->mi", R_odom_1, turns)]), A
