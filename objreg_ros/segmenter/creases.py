# SPDX-License-Identifier: Apache-2.0
"""Where two surfaces meet in a valley: the seam between things that touch.

Things are mostly convex, so the seam between two of them is mostly concave (Stein, Schoeler, Papon and Wörgötter,
"Object partitioning using local convexity", CVPR 2014): with normals n and points p on both sides of a cell,
(n_b - n_a)·(p_b - p_a) < 0 is a valley.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT, Surface

REACH = 3  # cells to each side


def find_creases(surface: Surface, angle_deg: float, jump: tuple[float, float]) -> Array:
    """(h, w) bool: the cells in a valley that bends by more than ``angle_deg``; ``jump`` (a, b) as in `reduce`."""
    valley = np.zeros(surface.depth.shape, np.bool_)
    bend = np.float32(2 * np.sin(np.radians(angle_deg) / 2))
    a, b = np.float32(jump[0]), np.float32(jump[1])
    _find(surface.depth, surface.normals, surface.x, surface.y, bend, a, b, valley)
    return valley


@numba.njit(cache=True, fastmath=EXACT)
def _find(depth, normals, x, y, bend, a, b, valley):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    for i in range(h):
        for j in range(w):
            z = depth[i, j]
            if z <= 0:
                continue
            jump = 2 * (a + b * z * z)
            left, right = max(j - REACH, 0), min(j + REACH, w - 1)
            top, bottom = max(i - REACH, 0), min(i + REACH, h - 1)
            valley[i, j] = _bends(depth, normals, x, y, i, left, i, right, bend, z, jump) or _bends(
                depth, normals, x, y, top, j, bottom, j, bend, z, jump
            )


@numba.njit(cache=True, fastmath=EXACT, inline="always")
def _bends(depth, normals, x, y, i, j, p, q, bend, z, jump):  # type: ignore[no-untyped-def]
    """Whether the surface between cells (i, j) and (p, q) is a valley of more than ``bend`` = 2 sin(angle / 2)."""
    s, t = depth[i, j], depth[p, q]
    if not (abs(s - z) < jump and abs(t - z) < jump):
        return False
    if normals[i, j, 2] == 0 or normals[p, q, 2] == 0:
        return False
    dx, dy, dz = x[q] * t - x[j] * s, y[p] * t - y[i] * s, t - s
    dot = (
        dx * (normals[p, q, 0] - normals[i, j, 0])
        + dy * (normals[p, q, 1] - normals[i, j, 1])
        + dz * (normals[p, q, 2] - normals[i, j, 2])
    )
    return dot < 0 and dot * dot > bend * bend * (dx * dx + dy * dy + dz * dz)


def find_steps(depth: Array, part: float, jump: tuple[float, float]) -> Array:
    """(h, w) bool: the cells where the depth bends by more than ``part`` of the depth step ``jump`` (a, b).

    The second difference vanishes on a plane however it slants, and sees a step that is spread over mixed pixels.
    """
    steps = np.zeros(depth.shape, np.bool_)
    _find_steps(depth, np.float32(part * jump[0]), np.float32(part * jump[1]), steps)
    return steps


@numba.njit(cache=True, fastmath=EXACT)
def _find_steps(depth, a, b, steps):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    for i in range(h):
        for j in range(w):
            z = depth[i, j]
            bend = a + b * z * z
            for p, q in ((0, 1), (1, 0)):
                if i >= p and j >= q and i + p < h and j + q < w:
                    before, after = depth[i - p, j - q], depth[i + p, j + q]
                    if before > 0 and after > 0 and abs(before + after - 2 * z) > bend:
                        steps[i, j] = True
