# SPDX-License-Identifier: Apache-2.0
"""Refinement of a pose in 6 DoF on the context: generalised ICP of small_gicp, from coarse to fine correspondences.

Segal, Haehnel and Thrun, "Generalized-ICP" (2009). The shrinking correspondence distance is the robust kernel: what
does not fit drops out. This is the one file that knows small_gicp.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import small_gicp

from objreg_ros.data import Alignment, Array

NEIGHBOURS = 12


class Cloud(NamedTuple):
    """Points ready for refinement: a small_gicp cloud with covariances, and its tree."""

    points: Any
    tree: Any

    def __len__(self) -> int:
        return int(self.points.size())


def prepare_cloud(xyz: Array, voxel: float) -> Cloud | None:
    """Thin points (N, 3) to ``voxel`` m and estimate their covariances; None with fewer than 30 left."""
    if len(xyz) < 30:
        return None
    points, tree = small_gicp.preprocess_points(xyz.astype(np.float64), voxel, NEIGHBOURS, 1)
    return Cloud(points, tree) if points.size() >= 30 else None


def refine(
    source: Cloud, target: Cloud, T_target_source: Array, reaches: tuple[float, ...], iterations: int
) -> Alignment:
    """Refine a pose; ``reaches`` m are the correspondence distances of the rounds, coarse to fine.

    ``overlap`` of what comes back is the share of source points with a partner in the last round. An optimiser that
    walked away comes back with ``converged`` False, and the pose that it ended at.
    """
    result = None
    for reach in reaches:
        result = small_gicp.align(
            target.points,
            source.points,
            target.tree,
            T_target_source,
            registration_type="GICP",
            max_correspondence_distance=reach,
            num_threads=1,
            max_iterations=iterations,
        )
        T_target_source = result.T_target_source
    assert result is not None, "refine: expected at least one reach, got none"
    inliers = int(result.num_inliers)
    return Alignment(
        T_target_source=np.ascontiguousarray(T_target_source, np.float64),
        information=in_target(np.asarray(result.H), T_target_source),
        inliers=inliers,
        overlap=inliers / len(source),
        rmse=float(np.sqrt(2.0 * result.error / max(1, inliers))),
        iterations=int(result.iterations),
        converged=bool(result.converged) and inliers > 0,
    )


def in_target(information: Array, T_target_source: Array) -> Array:
    """small_gicp's (6, 6) information of a step [r t] along the source's axes, as ours: [t r] along the target's.

    The rotation stays about the source camera, as in a ROS pose with covariance.
    """
    swap = np.r_[3:6, 0:3]
    R = T_target_source[:3, :3]
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = R.T, R.T
    return np.asarray(J.T @ information[np.ix_(swap, swap)] @ J)
