# SPDX-License-Identifier: Apache-2.0
"""A fast, robust point-to-plane ICP for many hypotheses: the closest point is looked up in a grid, not searched.

Chen and Medioni, "Object modelling by registration of multiple range images" (1992), with a shrinking Tukey weight and
compatible normals. It brings a hypothesis to its basin in under a millisecond; `refinement` finishes the best few.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.closest_points import IndexedSurface
from objreg_ros.registration.kernels.least_squares import add_normal_equations, move, solve
from objreg_ros.registration.kernels.projection import FAST, INDEX, moved
from objreg_ros.registration.prepare.prepared import Prepared

REACHES_M = (0.2, 0.1, 0.06)  # distance of a pair at first, in the basin, at the end
ITERATIONS = 15  # most of one round of ICP
SETTLING, SETTLING_POINTS = 8, 1000  # most iterations, and points, of the last one, of poses in their basins
LEAST_PAIRS = 60  # least number of paired points that hold a pose: ten times its freedoms
FACING = 0.6  # cosine between the normals of a pair, at least


def align(
    xyz: Array, normals: Array, surface: IndexedSurface, T: Array, reach: float, last_reach: float, iterations: int
) -> tuple[Array, Array, Array]:
    """Bring many poses (K, 4, 4) of oriented points (M, 3) to the surface, each to its own basin.

    Returns the poses (K, 4, 4), the share of points with a partner within ``last_reach`` m (K,) and their rmse (K,) m.
    """
    if len(T) == 0 or len(xyz) == 0 or len(surface) == 0:
        return np.array(T, float).reshape(-1, 4, 4), np.zeros(len(T)), np.full(len(T), np.inf)
    poses = np.ascontiguousarray(T, np.float64).copy()
    share, rmse = _align(xyz, normals, *surface.grid, poses, reach, last_reach, iterations)
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
    H, g = np.zeros((6, 6)), np.zeros(6)
    count, weight, squared, spread = normal_equations(xyz, normals, *surface.grid, T, reach, H, g)
    rmse = float(np.sqrt(squared / max(1e-9, weight)))
    return Fit(H, float(weight), int(count), rmse, max(0.05, float(np.sqrt(spread))))


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def normal_equations(P, N, Q, M, closest, low, cell, T, reach, H, g):  # type: ignore[no-untyped-def]
    """Fill H (6, 6) and g (6,) of the step [t r] at pose T; returns pairs, their weight, error and spread."""
    _, at, J, residual, weight = pair(P, N, Q, M, closest, low, cell, T, reach)
    H[:], g[:] = 0.0, 0.0
    add_normal_equations(J, residual, weight, H, g)
    total, squared, x, y, z, squares = 1e-9, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(weight)):
        w, a, b, c = weight[k], at[0, k], at[1, k], at[2, k]
        total += w
        squared += w * residual[k] * residual[k]
        x += w * a
        y += w * b
        z += w * c
        squares += w * (a * a + b * b + c * c)
    spread = squares / total - (x * x + y * y + z * z) / (total * total)
    return len(weight), total, squared, max(0.0, spread)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def pair(P, N, Q, M, closest, low, cell, T, reach):  # type: ignore[no-untyped-def]
    """The points P that T brings within ``reach`` m of the point closest to them, of a normal that is compatible.

    Their indices (n,), where they are (3, n), the Jacobian (6, n) of a left step [t r], the residual (n,) m and Tukey's
    weight (n,). As in `projection.py` everything is looked up first and doubted afterwards.
    """
    x, y, z = moved(P, T)
    met, partner = _partners(x, y, z, closest, low, cell)
    xx, xy, xz = T[0, 0], T[0, 1], T[0, 2]
    yx, yy, yz = T[1, 0], T[1, 1], T[1, 2]
    zx, zy, zz = T[2, 0], T[2, 1], T[2, 2]
    at, J = np.empty((3, len(met))), np.empty((6, len(met)))
    residual, weight = np.empty(len(met)), np.empty(len(met))
    nearness, n = 1.0 / (reach * reach), 0
    for k in range(len(met)):
        i, j = met[k], partner[k]
        a, b, c = x[i], y[i], z[i]
        nx, ny, nz = M[j, 0], M[j, 1], M[j, 2]
        dx, dy, dz = a - Q[j, 0], b - Q[j, 1], c - Q[j, 2]
        facing = (
            (xx * nx + yx * ny + zx * nz) * N[i, 0]
            + (xy * nx + yy * ny + zy * nz) * N[i, 1]
            + (xz * nx + yz * ny + zz * nz) * N[i, 2]
        )
        near = 1.0 - (dx * dx + dy * dy + dz * dz) * nearness
        met[n], residual[n], weight[n] = i, nx * dx + ny * dy + nz * dz, near * near
        at[0, n], at[1, n], at[2, n] = a, b, c
        J[0, n], J[1, n], J[2, n] = nx, ny, nz
        J[3, n], J[4, n], J[5, n] = b * nz - c * ny, c * nx - a * nz, a * ny - b * nx
        n += (near > 0.0) & (facing >= FACING)
    return met[:n], at[:, :n], J[:, :n], residual[:n], weight[:n]


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _partners(x, y, z, closest, low, cell):  # type: ignore[no-untyped-def]
    """Which of the places (N,) have a closest point in their cell of the grid, and which that is: (n,) indices each."""
    met, partner, n = np.empty(len(x), INDEX), np.empty(len(x), INDEX), 0
    rows, columns, layers = closest.shape
    x0, y0, z0, scale = float(low[0]), float(low[1]), float(low[2]), 1.0 / cell
    for i in range(len(x)):
        a, b, c = (x[i] - x0) * scale, (y[i] - y0) * scale, (z[i] - z0) * scale
        if not ((a >= 0.0) & (b >= 0.0) & (c >= 0.0) & (a < rows) & (b < columns) & (c < layers)):
            continue
        j = closest[INDEX(a), INDEX(b), INDEX(c)]
        met[n], partner[n] = i, max(j, 0)
        n += j >= 0
    return met[:n], partner[:n]


@numba.njit(cache=True, nogil=True)
def _align(P, N, Q, M, closest, low, cell, poses, reach, last_reach, iterations):  # type: ignore[no-untyped-def]
    share, rmse = np.zeros(len(poses)), np.full(len(poses), np.inf)
    H, g = np.empty((6, 6)), np.empty(6)
    for k in range(len(poses)):
        for iteration in range(iterations):
            now = reach * (last_reach / reach) ** (iteration / max(1, iterations - 3))
            count, _, _, _ = normal_equations(P, N, Q, M, closest, low, cell, poses[k], max(now, last_reach), H, g)
            if count < 20:
                break
            for a in range(6):
                H[a, a] += 1e-3 + 1e-6 * H[a, a]
                g[a] = -g[a]
            solve(H, g)
            if move(poses[k], g) < 2e-4 and now <= last_reach:
                break
        count, weight, squared, _ = normal_equations(P, N, Q, M, closest, low, cell, poses[k], last_reach, H, g)
        share[k] = count / len(P)
        rmse[k] = np.sqrt(squared / weight)
    return share, rmse


def settle(source: Prepared, target: Prepared, T_target_source: Array) -> tuple[Array, Array]:
    """Poses (K, 4, 4) in their basins, brought to where the whole shape holds them, and whether it does (K,)."""
    _, reach, last = REACHES_M
    some = slice(SETTLING_POINTS)
    asked = source.xyz[some], source.normals[some], target.surface
    T, share, _ = align(*asked, T_target_source, reach, last, SETTLING)
    return T, share * len(source.xyz) >= LEAST_PAIRS
