# SPDX-License-Identifier: Apache-2.0
"""Seams between things: valleys where they touch, and small steps where one covers the other.

Things are mostly convex, so the seam between two of them is mostly concave (Stein, Schoeler, Papon and Wörgötter,
"Object partitioning using local convexity", CVPR 2014): with normals n and points p on both sides of a cell,
(n_b - n_a)·(p_b - p_a) < 0 is a valley.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT, REACH, Surface

STEP = 0.5  # of a depth jump: the bend of the depth that is a step


def find_seams(surface: Surface, angle_deg: float, jump: tuple[float, float]) -> Array:
    """(h, w) bool: the cells in a valley that bends by more than ``angle_deg``, or at a step.

    From 1 m on the angle grows with the distance, as both the noise of normals and the length that they span do.

    A step is a second difference of the depth of more than half the ``jump`` a + b z²: it vanishes on a plane however
    that slants, and sees a step that is spread over mixed pixels.
    """
    seams = np.zeros(surface.depth.shape, np.bool_)
    bend = np.float32((2 * np.sin(np.radians(angle_deg) / 2)) ** 2)
    a, b = np.float32(jump[0]), np.float32(jump[1])
    if min(seams.shape) > 2 * REACH:
        _find(surface.depth, surface.normals, surface.x, surface.y, bend, a, b, seams)
    return seams


@numba.njit(cache=True, fastmath=EXACT, inline="always")
def _valley(dx, dy, dz, n, m, s, z, t, bend, jump):  # type: ignore[no-untyped-def]
    """1 where the surface from depth s over z to t, with normals n and m at its ends, is a valley, else 0."""
    zero, one = np.float32(0), np.float32(1)
    dot = dx * (m[0] - n[0]) + dy * (m[1] - n[1]) + dz * (m[2] - n[2])
    one_surface = max(abs(s - z), abs(t - z)) < jump
    known = n[2] * m[2] != zero
    deep = -dot * abs(dot) > bend * (dx * dx + dy * dy + dz * dz)
    return (one if one_surface else zero) * (one if known else zero) * (one if deep else zero)


@numba.njit(cache=True, fastmath=EXACT, inline="always")
def _bump(before, z, after, limit):  # type: ignore[no-untyped-def]
    zero, one = np.float32(0), np.float32(1)
    bent = abs(before + after - z - z) > limit
    return (one if before * after > zero else zero) * (one if bent else zero)


@numba.njit(cache=True, fastmath=EXACT, error_model="numpy")
def _find(depth, normals, x, y, bend, a, b, seams):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    two = np.float32(2)
    n_x, n_y, n_z = normals[0], normals[1], normals[2]
    for i in range(REACH, h - REACH):
        up, down = i - REACH, i + REACH
        for j in range(REACH, w - REACH):
            z = depth[i, j]
            jump = a + b * z * z
            left, right = j - REACH, j + REACH
            sharp = bend * max(z * z, np.float32(1))
            s, t = depth[i, left], depth[i, right]
            n, m = (n_x[i, left], n_y[i, left], n_z[i, left]), (n_x[i, right], n_y[i, right], n_z[i, right])
            seam = _valley(x[right] * t - x[left] * s, y[i] * (t - s), t - s, n, m, s, z, t, sharp, two * jump)
            s, t = depth[up, j], depth[down, j]
            n, m = (n_x[up, j], n_y[up, j], n_z[up, j]), (n_x[down, j], n_y[down, j], n_z[down, j])
            seam += _valley(x[j] * (t - s), y[down] * t - y[up] * s, t - s, n, m, s, z, t, sharp, two * jump)
            limit = np.float32(STEP) * jump
            seam += _bump(depth[i, j - 1], z, depth[i, j + 1], limit)
            seam += _bump(depth[i - 1, j], z, depth[i + 1, j], limit)
            seams[i, j] = (z > np.float32(0)) & (seam > np.float32(0))
