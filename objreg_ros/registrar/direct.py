# SPDX-License-Identifier: Apache-2.0
"""The end of a refinement on shape and grey at once: what shape lets slide, texture holds.

The point-to-plane error on the surface is joined by the difference of the high-passed grey where a point of one view
lands in the other, asked both ways, coarse to fine (Steinbrücker et al., "Real-time visual odometry from dense RGB-D
images", 2011; Park et al., "Colored point cloud registration revisited", 2017), with Geman and McClure's weight.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.registrar.icp import move, normal_equations, solve
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared
from objreg_ros.registrar.visibility import SHADELESS

STEPS = 8  # a level
SETTLED = 2e-4  # length of a last step, metres and radians


def finish(source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> tuple[Array, Array]:
    """The pose where shape and grey agree best, from one in its basin, and what grey adds to its information.

    The information (6, 6) is of a left step [t r], in the units of `icp.fit`: 1 is a point that holds its plane.
    Both views must have grey.
    """
    surface, few = target.surface, slice(params.grey_points)
    shape = (source.xyz, source.normals, surface.xyz, surface.normals, surface.closest, surface.low, surface.cell)
    a, b = source.sight, target.sight
    slops = params.depth_tolerance, params.depth_tolerance_growth
    T, K = np.ascontiguousarray(T_target_source, np.float64).copy(), np.zeros((6, 6))
    for here, there in zip(a.bands, b.bands, strict=True):  # the coarse one first
        _finish(
            shape, T, params.reaches[-1],
            (a.points[few], here.shades[few]), (a.near, a.far, here.detail, a.camera),
            (b.points[few], there.shades[few]), (b.near, b.far, there.detail, b.camera),
            params.grey_sigma, params.shape_sigma, slops, K,
        )  # fmt: skip
    return T, K * params.shape_sigma**2


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
        _invert(T, back)
        _add_grey(others, back, image, T, True, grey_sigma, slops, K, k)
        for i in range(6):
            for j in range(6):
                H[i, j] = H[i, j] / shape_sigma**2 + K[i, j]
            H[i, i] += 1.0 + 1e-6 * H[i, i]
            k[i] = -(g[i] / shape_sigma**2 + k[i])
        solve(H, k)
        if move(T, k) < SETTLED:
            break


@numba.njit(cache=True, nogil=True)
def _invert(T, back):  # type: ignore[no-untyped-def]
    """Fill ``back`` (4, 4) with the inverse of a pose."""
    for i in range(3):
        back[i, 3] = 0.0
        for j in range(3):
            back[i, j] = T[j, i]
            back[i, 3] -= T[j, i] * T[j, 3]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _add_grey(asked, T, image, T_target_source, backwards, sigma, slops, H, g):  # type: ignore[no-untyped-def]
    """Add the errors of grey of ``asked`` points, moved by ``T`` into ``image``; to be stepped is T_target_source.

    Backwards the points are the target's: a step moves the source's image the other way under them.
    """
    points, shades = asked
    near, far, detail, camera = image
    fx, fy, cx, cy = camera
    height, width = near.shape
    J = np.empty(6)
    for i in range(len(points)):
        x, y, z = _moved(T, points[i])
        if shades[i] >= SHADELESS or z < 0.1:
            continue
        u, v = fx * x / z + cx, fy * y / z + cy
        if u < 0.0 or v < 0.0 or u > width - 1.001 or v > height - 1.001:
            continue
        low, high = near[int(v + 0.5), int(u + 0.5)], far[int(v + 0.5), int(u + 0.5)]
        slop = 2.0 * (slops[0] + slops[1] * z * z)
        if high <= 0.0 or z < low - slop or z > high + slop or high - low > slop:
            continue
        shade, du, dv = _shade(detail, u, v)
        error = (shade - shades[i]) / sigma
        e = np.array([du * fx / z, dv * fy / z, -(du * fx * x + dv * fy * y) / (z * z)]) / sigma
        if backwards:
            e = -(T_target_source[:3, 0] * e[0] + T_target_source[:3, 1] * e[1] + T_target_source[:3, 2] * e[2])
            x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        J[:3] = e
        J[3], J[4], J[5] = y * e[2] - z * e[1], z * e[0] - x * e[2], x * e[1] - y * e[0]
        weight = 1.0 / (1.0 + error * error) ** 2
        for k in range(6):
            g[k] += weight * J[k] * error
            for m in range(6):
                H[k, m] += weight * J[k] * J[m]


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")
def _moved(T, p):  # type: ignore[no-untyped-def]
    return (
        T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + T[0, 3],
        T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + T[1, 3],
        T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3],
    )


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")
def _shade(detail, u, v):  # type: ignore[no-untyped-def]
    """The bilinear shade at a pixel and its slopes along u and v."""
    left, top = int(u), int(v)
    a, b = u - left, v - top
    p, q, r, s = detail[top, left], detail[top, left + 1], detail[top + 1, left], detail[top + 1, left + 1]
    shade = (1.0 - b) * ((1.0 - a) * p + a * q) + b * ((1.0 - a) * r + a * s)
    return shade, (1.0 - b) * (q - p) + b * (s - r), (1.0 - a) * (r - p) + a * (s - q)
