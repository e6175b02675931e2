# SPDX-License-Identifier: Apache-2.0
"""How well the surfaces hold a pose, by how much their patches contradict each other there.

Points of one patch err together: depth that is warped moves whole surfaces, and counting its points as independent is
what makes the covariance of an ICP over-confident. So each patch speaks once, with the sum of its residuals: the
cluster-robust covariance H^-1 (sum of g g') H^-1 (White, "Maximum likelihood estimation of misspecified models", 1982;
Liang and Zeger, "Longitudinal data analysis using generalized linear models", 1986), beside the usual H^-1. Points are
weighed by the noise that a structured-light camera has at their depth.

What two views share may be few patches, far away and on one side: then there is nothing to contradict, and a depth that
is a little wrong there turns the camera about them and takes it far. `warped` says how far.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.registrar.icp import Surface
from objreg_ros.registrar.params import RegistrarParams

NEAR = 0.4  # m, where the noise of depth is least
FREEDOMS = 6


def information(xyz: Array, normals: Array, surface: Surface, T: Array, params: RegistrarParams) -> Array:
    """The information (6, 6) of a left step [t r] of a pose (4, 4), of points (M, 3) on a surface.

    Next to zero along directions that no point resists.
    """
    noise = params.depth_noise, params.depth_noise_growth
    J, residual, weight, at = _pairs(
        xyz, normals, surface.xyz, surface.normals, surface.closest, surface.low, surface.cell, T,
        params.reaches[-1], noise,
    )  # fmt: skip
    least = np.eye(FREEDOMS)
    if len(J) <= FREEDOMS:
        return least
    H = (J.T * weight) @ J
    inverse = np.linalg.inv(H + least)
    excess = float((weight * residual**2).sum() / len(J))  # the residuals in units of the expected noise, squared
    C = (
        inverse @ _spread(J, weight * residual, _patches(at, J[:, :3], params.covariance_patch)) @ inverse
        + max(1.0, excess) * inverse
    )
    return np.linalg.inv((C + C.T) / 2.0)


def warped(xyz: Array, normals: Array, surface: Surface, T: Array, params: RegistrarParams) -> Array:
    """The covariance (6, 6) of a left step [t r] of a pose (4, 4) that wrong depths make, on top of `information`.

    The depth of each patch is wrong by a share ``depth_warp`` of the distance, one standard deviation, as it is of a
    camera whose depths bend with the place in the image.
    """
    noise = params.depth_noise, params.depth_noise_growth
    J, _, weight, at = _pairs(
        xyz, normals, surface.xyz, surface.normals, surface.closest, surface.low, surface.cell, T,
        params.reaches[-1], noise,
    )  # fmt: skip
    inverse = np.linalg.inv((J.T * weight) @ J + np.eye(FREEDOMS))
    error = params.depth_warp * np.linalg.norm(at, axis=1)
    g = _pulls(J, weight * error, _patches(at, J[:, :3], params.covariance_patch))
    return np.asarray(inverse @ g @ g.T @ inverse)


def _patches(at: Array, normals: Array, edge: float) -> Array:
    """The patch (n,) int64 that each point is of: a cube of space, and which way the surface faces."""
    cells = np.concatenate([np.floor(at / edge), np.rint(normals)], axis=1).astype(np.int64) + 512
    return np.asarray(cells @ 1024 ** np.arange(6, dtype=np.int64))


def _spread(J: Array, pull: Array, patch: Array) -> Array:
    """The sum (6, 6) of g g' over the patches, for as few patches as there are."""
    g = _pulls(J, pull, patch)
    count = g.shape[1]
    return np.asarray(g @ g.T * (count / max(1, count - FREEDOMS)))


def _pulls(J: Array, pull: Array, patch: Array) -> Array:
    """The sum of the pulls of the points of each patch: (6, number of patches)."""
    _, index = np.unique(patch, return_inverse=True)
    return np.stack([np.bincount(index.ravel(), J[:, k] * pull) for k in range(FREEDOMS)])


@numba.njit(cache=True, nogil=True)
def _pairs(P, N, Q, M, closest, low, cell, T, reach, noise):  # type: ignore[no-untyped-def]
    """Per pair: the Jacobian (n, 6) of a left step, the residual m, the robust weight over the noise, where it is."""
    J, residual = np.empty((len(P), 6)), np.empty(len(P))
    weight, at = np.empty(len(P)), np.empty((len(P), 3))
    n = 0
    for i in range(len(P)):
        x = T[0, 0] * P[i, 0] + T[0, 1] * P[i, 1] + T[0, 2] * P[i, 2] + T[0, 3]
        y = T[1, 0] * P[i, 0] + T[1, 1] * P[i, 1] + T[1, 2] * P[i, 2] + T[1, 3]
        z = T[2, 0] * P[i, 0] + T[2, 1] * P[i, 1] + T[2, 2] * P[i, 2] + T[2, 3]
        a, b, c = int((x - low[0]) / cell), int((y - low[1]) / cell), int((z - low[2]) / cell)
        if x < low[0] or y < low[1] or z < low[2]:
            continue
        if a >= closest.shape[0] or b >= closest.shape[1] or c >= closest.shape[2] or closest[a, b, c] < 0:
            continue
        j = closest[a, b, c]
        nx, ny, nz = M[j, 0], M[j, 1], M[j, 2]
        dx, dy, dz = x - Q[j, 0], y - Q[j, 1], z - Q[j, 2]
        d2 = (dx * dx + dy * dy + dz * dz) / (reach * reach)
        facing = 0.0
        for k in range(3):
            facing += M[j, k] * (T[k, 0] * N[i, 0] + T[k, 1] * N[i, 1] + T[k, 2] * N[i, 2])
        if d2 > 1.0 or facing < 0.6:
            continue
        J[n, 0], J[n, 1], J[n, 2] = nx, ny, nz
        J[n, 3], J[n, 4], J[n, 5] = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
        residual[n] = nx * dx + ny * dy + nz * dz
        here, there = max(0.0, P[i, 2] - NEAR), max(0.0, z - NEAR)
        variance = (noise[0] + noise[1] * here * here) ** 2 + (noise[0] + noise[1] * there * there) ** 2
        weight[n] = (1.0 - d2) ** 2 / variance
        at[n, 0], at[n, 1], at[n, 2] = x, y, z
        n += 1
    return J[:n], residual[:n], weight[:n], at[:n]
