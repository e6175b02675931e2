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

LEAST_DEPTH = 0.1  # m: nearer points are taken for points behind the camera
FAST = {"reassoc", "contract", "arcp", "nsz", "afn"}  # fast arithmetic that still knows NaN: it is in no picture
INDEX = np.uint32
ONE = INDEX(1)


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


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def lands(u, v, z, image):  # type: ignore[no-untyped-def]
    """Whether a point at a depth is before the camera and between four pixels of an ``image (h, w)``."""
    return (z >= LEAST_DEPTH) & (u >= 0.0) & (v >= 0.0) & (u <= image.shape[1] - 1.001) & (v <= image.shape[0] - 1.001)


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def nearest(u, v):  # type: ignore[no-untyped-def]
    """The row and the column of the pixel that a place in the image is in."""
    return INDEX(v + 0.5), INDEX(u + 0.5)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def visible(us, vs, zs, near, far, tolerance, growth):  # type: ignore[no-untyped-def]
    """Which of the projected points (N,) an image sees: (n,) indices.

    It measured between ``near`` and ``far (h, w)`` there, 0 where it measured nothing, and a depth z agrees within
    ``tolerance + growth z^2``.
    """
    found, n = np.empty(len(us), INDEX), 0
    for i in range(len(us)):
        u, v, z = us[i], vs[i], zs[i]
        if not lands(u, v, z, near):
            continue
        row, column = nearest(u, v)
        low, high = near[row, column], far[row, column]
        slop = tolerance + growth * z * z
        found[n] = i
        n += (high > 0.0) & (z >= low - slop) & (z <= high + slop)
    return found[:n]


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def between(image, u, v):  # type: ignore[no-untyped-def]
    """The bilinear value of an ``image (h, w)`` at a place between four pixels, and its slopes along u and v."""
    left, top = INDEX(u), INDEX(v)
    a, b = u - left, v - top
    p, q, r, s = image[top, left], image[top, left + ONE], image[top + ONE, left], image[top + ONE, left + ONE]
    value = (1.0 - b) * ((1.0 - a) * p + a * q) + b * ((1.0 - a) * r + a * s)
    return value, (1.0 - b) * (q - p) + b * (s - r), (1.0 - a) * (r - p) + a * (s - q)


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def spread(image, u, v, value):  # type: ignore[no-untyped-def]
    """Add a value, and its weight of 1, to the four pixels of an ``image (h, w, 2)`` about a place."""
    left, top = INDEX(u), INDEX(v)
    a, b = u - left, v - top
    _drop(image, top, left, (1.0 - b) * (1.0 - a), value)
    _drop(image, top, left + ONE, (1.0 - b) * a, value)
    _drop(image, top + ONE, left, b * (1.0 - a), value)
    _drop(image, top + ONE, left + ONE, b * a, value)


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _drop(image, row, column, weight, value):  # type: ignore[no-untyped-def]
    image[row, column, 0] += weight * value
    image[row, column, 1] += weight
