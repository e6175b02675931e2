# SPDX-License-Identifier: Apache-2.0
"""How far a trajectory is from the truth.

The absolute trajectory error of Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems" (2012): positions
after the rigid motion that fits the two trajectories best (Horn, 1987).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import pose, transform


def align(estimated: Array, true: Array) -> Array:
    """``T_true_estimated (4, 4)`` that brings points (N, 3) closest to their partners; ValueError without any."""
    if len(estimated) == 0 or estimated.shape != true.shape:
        raise ValueError(f"expected as many positions as true ones, at least 1, got {estimated.shape} and {true.shape}")
    mean_estimated, mean_true = estimated.mean(axis=0), true.mean(axis=0)
    U, _, Vt = np.linalg.svd((true - mean_true).T @ (estimated - mean_estimated))
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return pose(R, mean_true - R @ mean_estimated)


def absolute_errors(estimated: Sequence[Array], true: Sequence[Array]) -> Array:
    """The distance (N,) in metres of each pose (4, 4) from its partner after alignment."""
    positions, targets = (np.array([T[:3, 3] for T in poses]).reshape(-1, 3) for poses in (estimated, true))
    return np.linalg.norm(transform(align(positions, targets), positions) - targets, axis=1)


def absolute_trajectory_error(estimated: Sequence[Array], true: Sequence[Array]) -> float:
    """The root of the mean square of `absolute_errors`, m."""
    return float(np.sqrt(np.mean(absolute_errors(estimated, true) ** 2)))
