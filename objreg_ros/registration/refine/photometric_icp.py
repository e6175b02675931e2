# SPDX-License-Identifier: Apache-2.0
"""The end of a refinement on shape and grey at once: what shape lets slide, texture holds.

The point-to-plane error on the surface is joined by the difference of the high-passed grey where a point of one view
lands in the other, asked both ways, coarse to fine (Steinbrücker et al., "Real-time visual odometry from dense RGB-D
images", 2011; Park et al., "Colored point cloud registration revisited", 2017), with Geman and McClure's weight.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.least_squares import add_normal_equations, invert, move, solve
from objreg_ros.registration.kernels.projection import FAST, between, nearest, project, visible
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.prepare.views import SHADELESS
from objreg_ros.registration.refine.batch_icp import REACHES_M, normal_equations
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS
from objreg_ros.sensor import depth_tolerance

GREY_SIGMA = 0.7  # difference of the high-passed grey that weighs a quarter, in its deviations
SURFACE_SIGMA_M = 0.03  # distance from a surface that weighs as much as one deviation of grey
STEPS = 8  # a level
SETTLED = 2e-4  # length of a last step, metres and radians


def finish(source: Prepared, target: Prepared, T_target_source: Array) -> tuple[Array, Array]:
    """The pose where shape and grey agree best, from one in its basin, and what grey adds to its information.

    The information (6, 6) is of a left step [t r], in the units of `icp.fit`: 1 is a point that holds its plane.
    Both views must have grey.
    """
    few, shape = slice(PHOTOMETRIC_POINTS), (source.xyz, source.normals, *target.surface.grid)
    a, b = source.sight, target.sight
    slops = depth_tolerance(a.noise, b.noise)
    T, K = np.ascontiguousarray(T_target_source, np.float64).copy(), np.zeros((6, 6))
    for here, there in zip(a.bands, b.bands, strict=True):  # the coarse one first
        _finish(
            shape, T, REACHES_M[-1],
            (a.points[few], here.shades[few]), (a.near, a.far, here.detail, a.camera),
            (b.points[few], there.shades[few]), (b.near, b.far, there.detail, b.camera),
            GREY_SIGMA, SURFACE_SIGMA_M, slops, K,
        )  # fmt: skip
    return T, K * SURFACE_SIGMA_M**2


@numba.njit(cache=True, nogil=True)
def _finish(shape, T, reach, own, image, others, other_image, grey_sigma, shape_sigma, slops, K):  # type: ignore[no-untyped-def]
    """Gauss-Newton on one band: moves ``T`` (4, 4) and fills ``K`` (6, 6), the information of the grey."""
    P, N, Q, M, closest, low, cell = shape
    H, g, k = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    back = np.eye(4)
    for _ in range(STEPS):
        normal_equations(P, N, Q, M, closest, low, cell, T, reach, H, g)
        K[:], k[:] = 0.0, 0.0
        _add_grey(own, T, other_image, T, False, grey_sigma, slops, K, k)
        invert(T, back)
        _add_grey(others, back, image, T, True, grey_sigma, slops, K, k)
        for i in range(6):
            for j in range(6):
                H[i, j] = H[i, j] / shape_sigma**2 + K[i, j]
            H[i, i] += 1.0 + 1e-6 * H[i, i]
            k[i] = -(g[i] / shape_sigma**2 + k[i])
        solve(H, k)
        if move(T, k) < SETTLED:
            break


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _add_grey(asked, T, image, T_target_source, backwards, sigma, slops, H, g):  # type: ignore[no-untyped-def]
    """Add the errors of grey of ``asked`` points, moved by ``T`` into ``image``; to be stepped is T_target_source.

    Backwards the points are the target's: a step moves the source's image the other way under them.
    """
    points, shades = asked
    _, _, detail, camera = image
    fx, fy, cx, cy = camera
    us, vs, zs = project(points, T, camera)
    met = _met(us, vs, zs, shades, image, slops)
    J, error, weight = np.empty((6, len(met))), np.empty(len(met)), np.empty(len(met))
    for k in range(len(met)):
        i = met[k]
        u, v, z = us[i], vs[i], zs[i]
        shade, du, dv = between(detail, u, v)
        error[k] = (shade - shades[i]) / sigma
        weight[k] = 1.0 / (1.0 + error[k] * error[k]) ** 2
        nearness = 1.0 / (z * sigma)
        a, b, c = du * fx * nearness, dv * fy * nearness, -(du * (u - cx) + dv * (v - cy)) * nearness
        x, y = (u - cx) / fx * z, (v - cy) / fy * z
        if backwards:
            a, b, c = _turned(T_target_source, -a, -b, -c)
            x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        J[0, k], J[1, k], J[2, k] = a, b, c
        J[3, k], J[4, k], J[5, k] = y * c - z * b, z * a - x * c, x * b - y * a
    add_normal_equations(J, error, weight, H, g)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _met(us, vs, zs, shades, image, slops):  # type: ignore[no-untyped-def]
    """Which of the projected points the image meets within twice the tolerance, on a surface of both: (n,) indices."""
    near, far, _, _ = image
    base, growth = 2.0 * slops[0], 2.0 * slops[1]
    met, n = visible(us, vs, zs, near, far, base, growth), 0
    for k in range(len(met)):
        i = met[k]
        row, column = nearest(us[i], vs[i])
        slop = base + growth * zs[i] * zs[i]
        met[n] = i
        n += (far[row, column] - near[row, column] <= slop) & (shades[i] < SHADELESS)
    return met[:n]


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _turned(T, a, b, c):  # type: ignore[no-untyped-def]
    return (
        T[0, 0] * a + T[0, 1] * b + T[0, 2] * c,
        T[1, 0] * a + T[1, 1] * b + T[1, 2] * c,
        T[2, 0] * a + T[2, 1] * b + T[2, 2] * c,
    )
