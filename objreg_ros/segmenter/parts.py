# SPDX-License-Identifier: Apache-2.0
"""What is known of the connected parts in and around a box: size, place, and how they lie to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT, Surface, Window

ACROSS = 3  # cells over which two parts are neighbours
ALIKE = 0.12  # how far apart the shares of red, green and blue of one colour are
RIM = 0.7  # how much less a cell at the rim of the box counts than one in its middle


@dataclass(frozen=True, slots=True)
class Parts:
    """K connected parts of a surface, the largest in the box first, numbered from 1 in ``labels (h, w) int32``.

    Of each part: ``total`` and ``inside (K,)`` its cells and those in the box, ``weight (K,)`` those in the box where
    the middle counts more than the rim, ``extent (K, 4)`` left, top, right, bottom in cells, half open, ``size (K,)``
    the length in metres of the box's longer side at the part's depth, ``pure (K,)`` which share of it lies in the box,
    ``figure (K,)`` which share of its depth jumps is its own silhouette, 1 where it has none.

    Of each pair: ``alike (K, K)`` whether they have one colour in whatever light, False without colour, ``touching
    (K, K)`` the cells in which they are neighbours without a depth jump, ``gap (K, K)`` m the least distance over a
    border, ``front (K, 1 + K)`` the cells in which the first hides the second; column 0 is what is no part.
    """

    labels: Array
    total: Array
    inside: Array
    weight: Array
    extent: Array
    size: Array
    pure: Array
    figure: Array
    alike: Array
    touching: Array
    gap: Array
    front: Array

    def __len__(self) -> int:
        return len(self.total)


def measure(
    labels: Array,
    count: int,
    window: Window,
    surface: Surface,
    rgb: Array | None,
    jump: tuple[float, float],
    limit: int,
) -> Parts:
    """The ``limit`` largest parts of ``labels (h, w) int32``, 0 … ``count``, by their cells in ``window``.

    ``rgb (H, W, 3) uint8`` is the whole picture, or None.
    """
    left, top, right, bottom = window
    renamed = np.empty_like(labels)
    k = 1 + _rank(labels, count, np.array(window), limit, renamed)
    counts, extent = np.zeros((k, 4)), np.zeros((k, 4), np.int64)
    touching, front, gap = np.zeros((k, k), np.int64), np.zeros((k, k), np.int64), np.full((k, k), np.inf, np.float32)
    bounds = np.array(jump, np.float32)
    _count(renamed, np.array(window), surface.depth, counts, extent)
    _compare(renamed, surface.depth, surface.x, surface.y, bounds, touching, front, gap)
    total = counts[1:, 0]
    cell = float(surface.x[1] - surface.x[0]) if len(surface.x) > 1 else 0.0
    size = max(right - left, bottom - top) * cell * counts[1:, 3] / total
    shown = front[1:].sum(axis=1)
    return Parts(
        labels=renamed,
        total=total,
        inside=counts[1:, 1],
        weight=counts[1:, 2],
        extent=extent[1:],
        size=size,
        pure=counts[1:, 1] / total,
        figure=(shown + 1) / (shown + front[:, 1:].sum(axis=0) + 1),
        alike=np.zeros((k - 1, k - 1), np.bool_) if rgb is None else _alike(renamed, rgb, surface, k),
        touching=touching[1:, 1:],
        gap=np.sqrt(gap[1:, 1:]),
        front=front[1:],
    )


@numba.njit(cache=True)
def _rank(labels, count, window, limit, renamed):  # type: ignore[no-untyped-def]
    """Fill ``renamed`` with labels in the order of their cells in the window, 0 without any; how many there are."""
    left, top, right, bottom = window
    inside = np.zeros(count + 1, np.int64)
    for i in range(top, bottom):
        for j in range(left, right):
            inside[labels[i, j]] += 1
    inside[0] = 0
    number = np.zeros(count + 1, np.int32)
    kept = 0
    for k in np.argsort(-inside, kind="mergesort")[:limit]:
        if inside[k] > 0:
            kept += 1
            number[k] = kept
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            renamed[i, j] = number[labels[i, j]]
    return kept


def _alike(labels: Array, rgb: Array, surface: Surface, count: int) -> Array:
    """(K, K) bool: whether the shares of red, green and blue of two parts are about the same; ``count`` is K + 1."""
    sums = np.zeros((count, 4))
    _sum_colours(labels, rgb, surface.left, surface.top, surface.step, sums)
    colour = sums[1:, :3] + 8 * sums[1:, 3:]  # what is nearly black has no colour
    share = colour / colour.sum(axis=1, keepdims=True)
    return np.asarray(np.abs(share[:, None] - share[None]).sum(axis=-1) < ALIKE)


@numba.njit(cache=True)
def _sum_colours(labels, rgb, left, top, step, sums):  # type: ignore[no-untyped-def]
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            k = labels[i, j]
            if k > 0:
                v, u = top + i * step, left + j * step
                for c in range(3):
                    sums[k, c] += rgb[v, u, c]
                sums[k, 3] += 1


@numba.njit(cache=True, fastmath=EXACT)
def _count(labels, window, depth, counts, extent):  # type: ignore[no-untyped-def]
    h, w = labels.shape
    left, top, right, bottom = window
    for i in range(h):
        off_v = abs(2 * i + 1 - top - bottom) / (bottom - top)
        for j in range(w):
            k = labels[i, j]
            if k == 0:
                continue
            if counts[k, 0] == 0:
                extent[k, 0], extent[k, 1], extent[k, 2] = j, i, j + 1
            counts[k, 0] += 1
            counts[k, 3] += depth[i, j]
            extent[k, 0], extent[k, 2] = min(extent[k, 0], j), max(extent[k, 2], j + 1)
            extent[k, 3] = i + 1
            if i >= top and i < bottom and j >= left and j < right:
                off_u = abs(2 * j + 1 - left - right) / (right - left)
                counts[k, 1] += 1
                counts[k, 2] += 1 - RIM * max(off_u, off_v)


@numba.njit(cache=True, fastmath=EXACT)
def _compare(labels, depth, x, y, bounds, touching, front, gap):  # type: ignore[no-untyped-def]
    """Fill the tables of pairs from the cells next to each other; ``gap`` gets squares of metres."""
    h, w = labels.shape
    for i in range(h):
        for j in range(w):
            s = depth[i, j]
            if s <= 0:
                continue
            k = labels[i, j]
            jump = bounds[0] + bounds[1] * s * s
            for d in range(1, ACROSS + 1):
                if i + d < h and labels[i + d, j] != k:
                    _pair(labels, depth, x, y, i, j, i + d, j, d, jump, touching, front, gap)
                if j + d < w and labels[i, j + d] != k:
                    _pair(labels, depth, x, y, i, j, i, j + d, d, jump, touching, front, gap)


@numba.njit(cache=True, fastmath=EXACT)
def _pair(labels, depth, x, y, i, j, p, q, d, jump, touching, front, gap):  # type: ignore[no-untyped-def]
    """Count one pair of cells of two parts, ``d`` cells from each other."""
    k, o = labels[i, j], labels[p, q]
    s, t = depth[i, j], depth[p, q]
    if t <= 0:
        return
    if k > 0 and o > 0:
        square = (x[q] * t - x[j] * s) ** 2 + (y[p] * t - y[i] * s) ** 2 + (t - s) ** 2
        gap[k, o] = min(gap[k, o], square)
        gap[o, k] = gap[k, o]
    if d == 1 and abs(t - s) < jump:
        touching[k, o] += 1
        touching[o, k] += 1
    elif d <= 2 and t - s >= jump:
        front[k, o] += 1
    elif d <= 2 and s - t >= jump:
        front[o, k] += 1
