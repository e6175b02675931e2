# SPDX-License-Identifier: Apache-2.0
"""How well the surfaces hold a pose, by how much their patches contradict each other there.

Points of one patch err together: depth that errs systematically moves whole surfaces, and counting its points as
independent is what makes the covariance of an ICP over-confident. So each patch counts once, with the sum of its
residuals: the cluster-robust covariance H^-1 (sum of g g') H^-1 (White, "Maximum likelihood estimation of misspecified
models", 1982; Liang and Zeger, "Longitudinal data analysis using generalized linear models", 1986), beside the usual
H^-1. Points are weighed by the noise that their camera has at their depth.

What two views share may be few patches, far away and on one side: then there is nothing to contradict, and a depth that
is a little wrong there turns the camera about them and takes it far. `systematic_depth_error_of_step` says how far.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.closest_points import IndexedSurface
from objreg_ros.registration.refine.batch_icp import REACHES_M, pair
from objreg_ros.sensor import DEPTH_WARP, depth_sigma

PATCH_M = 0.8  # edge of a patch of surface whose points err together
FREEDOMS = 6
Noises = tuple[float, float]
KINECTS: Noises = (1.0, 1.0)  # how noisy the depth of two cameras is, in that of a Kinect


def information(xyz: Array, normals: Array, surface: IndexedSurface, T: Array, noises: Noises = KINECTS) -> Array:
    """The information (6, 6) of a left step [t r] of a pose (4, 4), of points (M, 3) on a surface.

    ``noises`` are the `depth_noise` of the camera of the points and of that of the surface. Next to zero along
    directions that no point resists.
    """
    at, J, residual, weight = _weighed(xyz, normals, surface, T, noises)
    least = np.eye(FREEDOMS)
    if len(residual) <= FREEDOMS:
        return least
    inverse = np.linalg.inv((J * weight) @ J.T + least)
    excess = float((weight * residual**2).sum() / len(residual))  # in units of the expected noise, squared
    C = inverse @ _spread(J, weight * residual, _patches(at, J[:3], PATCH_M)) @ inverse + max(1.0, excess) * inverse
    return np.linalg.inv((C + C.T) / 2.0)


def systematic_depth_error_of_step(
    xyz: Array, normals: Array, surface: IndexedSurface, T: Array, noises: Noises = KINECTS
) -> Array:
    """The covariance (6, 6) of a left step [t r] of a pose (4, 4) that wrong depths make, on top of `information`.

    The depth of each patch is wrong by a share `DEPTH_WARP` of the distance, one standard deviation, as it is of a
    camera whose depths bend with the place in the image.
    """
    at, J, _, weight = _weighed(xyz, normals, surface, T, noises)
    inverse = np.linalg.inv((J * weight) @ J.T + np.eye(FREEDOMS))
    error = DEPTH_WARP * np.linalg.norm(at, axis=0)
    g = _pulls(J, weight * error, _patches(at, J[:3], PATCH_M))
    return np.asarray(inverse @ g @ g.T @ inverse)


def _weighed(
    xyz: Array, normals: Array, surface: IndexedSurface, T: Array, noises: Noises
) -> tuple[Array, Array, Array, Array]:
    """Per pair: where it is (3, n), the Jacobian (6, n) of a left step, the residual m, the weight over the noise."""
    index, at, J, residual, weight = pair(xyz, normals, *surface.grid, T, REACHES_M[-1])
    variance = depth_sigma(xyz[index, 2], noises[0]) ** 2 + depth_sigma(at[2], noises[1]) ** 2
    return at, J, residual, weight / variance


def _patches(at: Array, normals: Array, edge: float) -> Array:
    """The patch (n,) int64 that each point is of: a cube of space, and the side that the surface faces; (3, n) each."""
    cells = np.concatenate([np.floor(at / edge), np.rint(normals)]).astype(np.int64) + 512
    return np.asarray(1024 ** np.arange(6, dtype=np.int64) @ cells)


def _spread(J: Array, pull: Array, patch: Array) -> Array:
    """The sum (6, 6) of g g' over the patches, for as few patches as there are."""
    g = _pulls(J, pull, patch)
    count = g.shape[1]
    return np.asarray(g @ g.T * (count / max(1, count - FREEDOMS)))


def _pulls(J: Array, pull: Array, patch: Array) -> Array:
    """The sum of the pulls of the points of each patch: (6, number of patches)."""
    _, index = np.unique(patch, return_inverse=True)
    return np.stack([np.bincount(index.ravel(), row * pull) for row in J])
