# SPDX-License-Identifier: Apache-2.0
"""Holes in an object: what lies within it without a depth jump is of it, such as the flat bottom of a bowl."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT

SMOOTH = 0.6  # share of a hole's border without a depth jump


def fill_holes(chosen: Array, depth: Array, jump: tuple[float, float]) -> None:
    """Add to ``chosen (h, w) bool``, in place, the cells it surrounds that mostly go on without a depth jump."""
    if chosen.size == 0 or not chosen.any():
        return
    count, labels = cv2.connectedComponents((~chosen).view(np.uint8), connectivity=4)
    if count < 3:
        return
    open_air = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    closed = np.ones(count, np.bool_)
    closed[open_air] = closed[0] = False
    if not closed.any():
        return
    border = np.zeros((count, 2), np.int64)
    _count_border(labels, depth, np.float32(jump[0]), np.float32(jump[1]), border)
    filled = closed & (border[:, 1] >= SMOOTH * np.maximum(border[:, 0], 1))
    chosen |= filled[labels] & (depth > 0)


@numba.njit(cache=True, fastmath=EXACT)
def _count_border(labels, depth, a, b, border):  # type: ignore[no-untyped-def]
    """Of each label: the pairs of a cell with depth and a chosen one (label 0) beside it, and those without a jump."""
    h, w = labels.shape
    for i in range(1, h - 1):
        for j in range(1, w - 1):
            k = labels[i, j]
            z = depth[i, j]
            if k == 0 or z <= 0:
                continue
            for p, q in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                if labels[p, q] == 0:
                    border[k, 0] += 1
                    if abs(depth[p, q] - z) < a + b * z * z:
                        border[k, 1] += 1
