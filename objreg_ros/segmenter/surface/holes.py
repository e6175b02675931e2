# SPDX-License-Identifier: Apache-2.0
"""Holes in an object: what lies within it without a depth jump is of it, such as the flat bottom of a bowl."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import EXACT
from objreg_ros.segmenter.surface.components import connect

OPEN = 1 << 40  # more pairs of cells than there are
SMOOTH = 0.6  # share of a hole's border without a depth jump


def fill_holes(chosen: Array, depth: Array, jump: tuple[float, float]) -> None:
    """Add to ``chosen (h, w) bool``, in place, the surfaces it surrounds that mostly go on without a depth jump.

    A surface is surrounded when it ends, at a depth jump or at a chosen cell, before it leaves the box around them.
    """
    left, top, right, bottom = _bounds(chosen)
    if right - left < 3 or bottom - top < 3:
        return
    within = np.ascontiguousarray(depth[top:bottom, left:right])
    labels, count = connect(within, ~chosen[top:bottom, left:right], jump)
    if count > 0:
        _fill(chosen, left, top, within, labels, count, np.float32(jump[0]), np.float32(jump[1]))


@numba.njit(cache=True, nogil=True)
def _bounds(chosen):  # type: ignore[no-untyped-def]
    """Left, top, right and bottom of the chosen cells, half open; all 0 for none."""
    left, top, right, bottom = chosen.shape[1], 0, 0, 0
    for i in range(chosen.shape[0]):
        row = chosen[i]
        first, last = 0, len(row)
        while first < last and not row[first]:
            first += 1
        if first == last:
            continue
        while not row[last - 1]:
            last -= 1
        top, bottom = i if bottom == 0 else top, i + 1
        left, right = min(left, first), max(right, last)
    return (left, top, right, bottom) if bottom > 0 else (0, 0, 0, 0)


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _fill(chosen, left, top, depth, labels, count, a, b):  # type: ignore[no-untyped-def]
    h, w = labels.shape
    pairs, smooth = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    for i in range(h):
        for j in range(w):
            k = labels[i, j]
            if k == 0 or depth[i, j] <= 0:
                continue
            if i == 0 or j == 0 or i == h - 1 or j == w - 1:
                pairs[k] = OPEN
                continue
            limit = a + b * depth[i, j] * depth[i, j]
            for p, q in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                if chosen[top + p, left + q]:
                    pairs[k] += 1
                    smooth[k] += abs(depth[p, q] - depth[i, j]) < limit
    for i in range(h):
        for j in range(w):
            k = labels[i, j]
            if k > 0 and depth[i, j] > 0 and smooth[k] > 0 and smooth[k] >= SMOOTH * pairs[k]:
                chosen[top + i, left + j] = True
