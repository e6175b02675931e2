# SPDX-License-Identifier: Apache-2.0
"""A fast, robust point-to-plane ICP for many hypotheses: the closest point is looked up in a grid, not searched.

Chen and Medioni, "Object modelling by registration of multiple range images" (1992), with a shrinking Tukey weight and
compatible normals. It brings a hypothesis to its basin in under a millisecond; `refinement` finishes the best few.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.kernels.closest_points import IndexedSurface
from objreg_ros.registration.prepare.prepared import Prepared

_KERNELS = kernels("batch_icp")
REACHES_M = (0.2, 0.1, 0.06)  # distance of a pair at first, in the basin, at the end
ITERATIONS = 15  # most of one round of ICP
SETTLING, SETTLING_POINTS = 8, 1000  # most iterations, and points, of the last one, of poses in their basins
LEAST_PAIRS = 60  # least number of paired points that hold a pose: ten times its freedoms


def align(
    xyz: Array, normals: Array, surface: IndexedSurface, T: Array, reach: float, last_reach: float, iterations: int
) -> tuple[Array, Array, Array]:
    """Bring many poses (K, 4, 4) of oriented points (M, 3) to the surface, each to its own basin.

    Returns the poses (K, 4, 4), the share of points with a partner within ``last_reach`` m (K,) and their rmse (K,) m.
    """
    if len(T) == 0 or len(xyz) == 0 or len(surface) == 0:
        return np.array(T, float).reshape(-1, 4, 4), np.zeros(len(T)), np.full(len(T), np.inf)
    poses = np.ascontiguousarray(T, np.float64).copy()
    share, rmse = _KERNELS.align(xyz, normals, surface.grid, poses, reach, last_reach, iterations)
    return poses, share, rmse


class Fit(NamedTuple):
    """How a pose fits: ``H (6, 6)`` of a left step [t r], the weight and number of pairs, m, and their extent in m."""

    H: Array
    weight: float
    inliers: int
    rmse: float
    extent: float


def fit(xyz: Array, normals: Array, surface: IndexedSurface, T: Array, reach: float) -> Fit:
    """The fit of one pose (4, 4): what of the points (M, 3) has a partner within ``reach`` m."""
    H = np.zeros((6, 6))
    count, weight, squared, spread = _KERNELS.fit(xyz, normals, surface.grid, T, reach, H)
    rmse = float(np.sqrt(squared / max(1e-9, weight)))
    return Fit(H, weight, count, rmse, max(0.05, float(np.sqrt(spread))))


def pair(
    xyz: Array,
    normals: Array,
    to: Array,
    facing: Array,
    closest: Array,
    low: Array,
    cell: float,
    T: Array,
    reach: float,
) -> tuple[Array, Array, Array, Array, Array]:
    """The points that T (4, 4) brings within ``reach`` m of the closest of an `IndexedSurface.grid`, normals alike.

    Their indices (n,), where they are (3, n), the Jacobian (6, n) of a left step [t r], the residual (n,) m and Tukey's
    weight (n,).
    """
    index, at, J, residual, weight = _KERNELS.pair(xyz, normals, to, facing, closest, low, cell, T, reach)
    return index, at, J, residual, weight


def settle(source: Prepared, target: Prepared, T_target_source: Array) -> tuple[Array, Array]:
    """Poses (K, 4, 4) in their basins, brought to where the whole shape holds them, and whether it does (K,)."""
    _, reach, last = REACHES_M
    some = slice(SETTLING_POINTS)
    asked = source.xyz[some], source.normals[some], target.surface
    T, share, _ = align(*asked, T_target_source, reach, last, SETTLING)
    return T, share * len(source.xyz) >= LEAST_PAIRS
