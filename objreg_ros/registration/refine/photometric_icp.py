# SPDX-License-Identifier: Apache-2.0
"""The end of a refinement on shape and grey at once: what shape lets slide, texture holds.

The point-to-plane error on the surface is joined by the difference of the high-passed grey where a point of one view
lands in the other, asked both ways, coarse to fine (Steinbrücker et al., "Real-time visual odometry from dense RGB-D
images", 2011; Park et al., "Colored point cloud registration revisited", 2017), with Geman and McClure's weight.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.refine.batch_icp import REACHES_M
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS
from objreg_ros.sensor import depth_tolerance

_KERNELS = kernels("photometric_icp")
GREY_SIGMA = 0.7  # difference of the high-passed grey that weighs a quarter, in its deviations
SURFACE_SIGMA_M = 0.03  # distance from a surface that weighs as much as one deviation of grey


def finish(source: Prepared, target: Prepared, T_target_source: Array) -> tuple[Array, Array]:
    """The pose where shape and grey agree best, from one in its basin, and what grey adds to its information.

    The information (6, 6) is of a left step [t r], in the units of `icp.fit`: 1 is a point that holds its plane.
    Both views must have grey.
    """
    few, shape = slice(PHOTOMETRIC_POINTS), (source.xyz, source.normals)
    a, b = source.sight, target.sight
    slops = depth_tolerance(a.noise, b.noise)
    T, K = np.ascontiguousarray(T_target_source, np.float64).copy(), np.zeros((6, 6))
    for here, there in zip(a.bands, b.bands, strict=True):  # the coarse one first
        _KERNELS.finish(
            shape, target.surface.grid, T, REACHES_M[-1],
            (a.points[few], here.shades[few]), (a.near, a.far, here.detail, a.camera),
            (b.points[few], there.shades[few]), (b.near, b.far, there.detail, b.camera),
            GREY_SIGMA, SURFACE_SIGMA_M, slops, K,
        )  # fmt: skip
    return T, K * SURFACE_SIGMA_M**2
