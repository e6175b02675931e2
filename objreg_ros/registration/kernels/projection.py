# SPDX-License-Identifier: Apache-2.0
"""Kernels that project points into a camera and read its image there. Other kernels call them first.

All points are projected before any pixel is read, so that the processor projects several points at a time. The code
that follows reads a pixel first and tests its value afterwards, so that it too runs for several points at a time.
Together this takes a third of the time of one loop over the points. Indices are unsigned, because numba tests each
signed index for a negative value.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.native import kernels

_KERNELS = kernels("projection")
LEAST_DEPTH = 0.1  # m: nearer points are taken for points behind the camera
FAST = {"reassoc", "contract", "arcp", "nsz", "afn"}  # fast arithmetic that still knows NaN: it is in no picture
INDEX = np.uint32
between = _KERNELS.between  # (image, u, v): the bilinear value of an image (h, w) float64, its slopes along u and v
lands = _KERNELS.lands  # (u, v, z, image): whether a point is before the camera and between four pixels of an image
nearest = _KERNELS.nearest  # (u, v): the row and the column of the pixel that a place in the image is in
spread = _KERNELS.spread  # (image, u, v, value): add a value, and its weight of 1, to four pixels of (h, w, 2) float32


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def moved(points, T):  # type: ignore[no-untyped-def]
    """The x, y and z (N,) of ``points (N, 3)`` moved by ``T (4, 4)``."""
    xx, xy, xz, x0 = T[0, 0], T[0, 1], T[0, 2], T[0, 3]
    yx, yy, yz, y0 = T[1, 0], T[1, 1], T[1, 2], T[1, 3]
    zx, zy, zz, z0 = T[2, 0], T[2, 1], T[2, 2], T[2, 3]
    x, y, z = np.empty(len(points)), np.empty(len(points)), np.empty(len(points))
    for i in range(len(points)):
        a, b, c = points[i, 0], points[i, 1], points[i, 2]
        x[i] = xx * a + xy * b + xz * c + x0
        y[i] = yx * a + yy * b + yz * c + y0
        z[i] = zx * a + zy * b + zz * c + z0
    return x, y, z


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def project(points, T, camera):  # type: ignore[no-untyped-def]
    """The pixels u, v and the depths z (N,) of ``points (N, 3)`` moved by ``T (4, 4)``; for `lands` to sort out."""
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    u, v, z = moved(points, T)
    for i in range(len(points)):
        inverse = 1.0 / max(z[i], LEAST_DEPTH)
        u[i] = fx * u[i] * inverse + cx
        v[i] = fy * v[i] * inverse + cy
    return u, v, z
