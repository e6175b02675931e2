# SPDX-License-Identifier: Apache-2.0
"""Seams between objects: valleys where they touch, and small steps where one covers the other.

Objects are mostly convex, so the seam between two of them is mostly concave (Stein, Schoeler, Papon and Wörgötter,
"Object partitioning using local convexity", CVPR 2014): with normals n and points p on both sides of a cell,
(n_b - n_a)·(p_b - p_a) < 0 is a valley.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import EXACT, REACH, Surface

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


@numba.njit(cache=True, nogil=True, fastmath=EXACT, inline="always")
def _valley(p, q, z, n, m, bend, jump):  # type: ignore[no-untyped-def]
    """Whether the surface from point p over depth z to point q, with normals n and m there, is a valley."""
    d_x, d_y, d_z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    dot = d_x * (m[0] - n[0]) + d_y * (m[1] - n[1]) + d_z * (m[2] - n[2])
    one_surface = max(abs(p[2] - z), abs(q[2] - z)) < jump
    known = n[2] * m[2] != np.float32(0)
    return one_surface & known & (-dot * abs(dot) > bend * (d_x * d_x + d_y * d_y + d_z * d_z))


@numba.njit(cache=True, nogil=True, fastmath=EXACT, inline="always")
def _bump(before, z, after, limit):  # type: ignore[no-untyped-def]
    return (abs(before + after - z - z) > limit) & (before * after > np.float32(0))


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _find(depth, normals, x, y, bend, a, b, seams):  # type: ignore[no-untyped-def]
    """Fill ``seams`` row by row: rows shifted against each other, so that the CPU's vectors see plain indices."""
    h, w = depth.shape
    n = w - 2 * REACH
    zero, one, two, step = np.float32(0), np.float32(1), np.float32(2), np.float32(STEP)
    x_left, x_here, x_right = x[:n], x[REACH : n + REACH], x[2 * REACH :]
    for i in range(REACH, h - REACH):
        y_up, y_here, y_down = y[i - REACH], y[i], y[i + REACH]
        row = depth[i]
        here, far_left, far_right = row[REACH : n + REACH], row[:n], row[2 * REACH :]
        left, right = row[REACH - 1 : n + REACH - 1], row[REACH + 1 : n + REACH + 1]
        up, down = depth[i - 1][REACH : n + REACH], depth[i + 1][REACH : n + REACH]
        far_up, far_down = depth[i - REACH][REACH : n + REACH], depth[i + REACH][REACH : n + REACH]
        l_x, l_y, l_z = normals[0, i][:n], normals[1, i][:n], normals[2, i][:n]
        r_x, r_y, r_z = normals[0, i][2 * REACH :], normals[1, i][2 * REACH :], normals[2, i][2 * REACH :]
        u_x, u_y, u_z = normals[0, i - REACH][REACH:], normals[1, i - REACH][REACH:], normals[2, i - REACH][REACH:]
        d_x, d_y, d_z = normals[0, i + REACH][REACH:], normals[1, i + REACH][REACH:], normals[2, i + REACH][REACH:]
        out = seams[i][REACH : n + REACH]
        for j in range(n):
            z = here[j]
            jump = a + b * z * z
            sharp = bend * max(z * z, one)
            s, t = far_left[j], far_right[j]
            p, q = (x_left[j] * s, y_here * s, s), (x_right[j] * t, y_here * t, t)
            seam = _valley(p, q, z, (l_x[j], l_y[j], l_z[j]), (r_x[j], r_y[j], r_z[j]), sharp, two * jump)
            s, t = far_up[j], far_down[j]
            p, q = (x_here[j] * s, y_up * s, s), (x_here[j] * t, y_down * t, t)
            seam |= _valley(p, q, z, (u_x[j], u_y[j], u_z[j]), (d_x[j], d_y[j], d_z[j]), sharp, two * jump)
            seam |= _bump(left[j], z, right[j], step * jump) | _bump(up[j], z, down[j], step * jump)
            out[j] = seam & (z > zero)
