# SPDX-License-Identifier: Apache-2.0
"""Connected parts of a surface: cells that touch without a depth jump between them.

Union-find over the cells (Rosenfeld and Pfaltz, "Sequential operations in digital picture processing", 1966), with
links that reach over small holes in the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT

LINKS = np.array([(0, -1), (-1, 0), (-1, -1), (-1, 1), (0, -2), (-2, 0)])


def connect(depth: Array, keep: Array, jump: tuple[float, float]) -> tuple[Array, int]:
    """The parts of the cells ``keep (h, w) bool``: labels (h, w) int32, 0 where not kept, else 1 … count; and count.

    Two cells are linked where their ``depth (h, w)`` differs by less than a + b z² of ``jump`` = (a, b).
    """
    labels = np.empty(depth.shape, np.int32)
    count = _connect(depth, keep, np.float32(jump[0]), np.float32(jump[1]), LINKS, labels)
    return labels, int(count)


@numba.njit(cache=True, inline="always")
def _root(parent, k):  # type: ignore[no-untyped-def]
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@numba.njit(cache=True, fastmath=EXACT)
def _connect(depth, keep, a, b, links, labels):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    parent = np.arange(h * w, dtype=np.int32)
    for i in range(h):
        for j in range(w):
            if not keep[i, j]:
                continue
            z = depth[i, j]
            jump = a + b * z * z
            for k in range(len(links)):
                p, q = i + links[k, 0], j + links[k, 1]
                if p >= 0 and q >= 0 and q < w and keep[p, q] and abs(depth[p, q] - z) < jump:
                    r, s = _root(parent, np.int32(i * w + j)), _root(parent, np.int32(p * w + q))
                    if r < s:
                        parent[s] = r
                    elif s < r:
                        parent[r] = s
    return _number(parent, keep, labels)


@numba.njit(cache=True)
def _number(parent, keep, labels):  # type: ignore[no-untyped-def]
    """Fill ``labels`` with 1 … count in the order of the roots."""
    h, w = labels.shape
    count = 0
    for i in range(h):
        for j in range(w):
            labels[i, j] = 0
            if keep[i, j]:
                k = i * w + j
                root = _root(parent, k)
                if root == k:  # a root is the first cell of its part, so it is met before the others
                    count += 1
                    labels[i, j] = count
                else:
                    labels[i, j] = labels[root // w, root % w]
    return count


def grow(labels: Array, depth: Array, keep: Array, jump: tuple[float, float], rounds: int) -> None:
    """Let the parts grow in place into the cells of ``keep`` that have no label, one ring of cells a round.

    A cell takes the label of the neighbour nearest in depth, within ``jump``; where two parts grow towards each other
    they meet half way.
    """
    _grow(labels, depth, keep, np.float32(jump[0]), np.float32(jump[1]), rounds)


@numba.njit(cache=True, fastmath=EXACT)
def _grow(labels, depth, keep, a, b, rounds):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    cells = [(np.int32(0), np.int32(0), np.int32(0)) for _ in range(0)]
    for _ in range(rounds):
        cells.clear()
        for i in range(h):
            for j in range(w):
                if not keep[i, j] or labels[i, j] > 0:
                    continue
                nearest = a + b * depth[i, j] * depth[i, j]
                label = np.int32(0)
                for p, q in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    if p >= 0 and q >= 0 and p < h and q < w and labels[p, q] > 0:
                        step = abs(depth[p, q] - depth[i, j])
                        if step < nearest:
                            nearest = step
                            label = labels[p, q]
                if label > 0:
                    cells.append((np.int32(i), np.int32(j), label))
        if len(cells) == 0:
            return
        for i, j, label in cells:
            labels[i, j] = label


@dataclass(frozen=True, slots=True)
class Parts:
    """K connected parts of a surface, largest in the box first, numbered from 1 in ``labels (h, w) int32``.

    ``total`` and ``inside (K,)`` count the cells of a part and those in the box; ``weight (K,)`` those in the box, the
    middle more than the rim; ``extent (K, 4)`` is left, top, right, bottom in cells, half open; ``contact (K, K)``
    counts the neighbouring cells of two parts without a depth jump between them.
    """

    labels: Array
    total: Array
    inside: Array
    weight: Array
    extent: Array
    contact: Array

    def __len__(self) -> int:
        return len(self.total)


def measure(
    labels: Array, count: int, window: tuple[int, int, int, int], depth: Array, jump: tuple[float, float], limit: int
) -> Parts:
    """The ``limit`` largest parts of ``labels`` by their cells in ``window`` (left, top, right, bottom, half open)."""
    left, top, right, bottom = window
    inside = np.bincount(labels[top:bottom, left:right].ravel(), minlength=count + 1)
    inside[0] = 0
    order = np.argsort(-inside, kind="stable")[:limit]
    order = order[inside[order] > 0]
    number = np.zeros(count + 1, np.int32)
    number[order] = np.arange(1, len(order) + 1)
    renamed = number[labels]
    k = len(order) + 1
    counts, extent = np.zeros((k, 3), np.float64), np.zeros((k, 4), np.int64)
    contact = np.zeros((k, k), np.int64)
    _measure(renamed, np.array(window), depth, np.float32(jump[0]), np.float32(jump[1]), counts, extent, contact)
    return Parts(renamed, counts[1:, 0], counts[1:, 1], counts[1:, 2], extent[1:], contact[1:, 1:])


@numba.njit(cache=True, fastmath=EXACT)
def _measure(labels, window, depth, a, b, counts, extent, contact):  # type: ignore[no-untyped-def]
    h, w = labels.shape
    left, top, right, bottom = window
    for i in range(h):
        for j in range(w):
            k = labels[i, j]
            if k == 0:
                continue
            if counts[k, 0] == 0:
                extent[k, 0], extent[k, 1], extent[k, 2], extent[k, 3] = j, i, j + 1, i + 1
            counts[k, 0] += 1
            extent[k, 0], extent[k, 2] = min(extent[k, 0], j), max(extent[k, 2], j + 1)
            extent[k, 3] = i + 1
            if i >= top and i < bottom and j >= left and j < right:
                off_v = abs(2 * i + 1 - top - bottom) / (bottom - top)
                off_u = abs(2 * j + 1 - left - right) / (right - left)
                counts[k, 1] += 1
                counts[k, 2] += 1 - 0.7 * max(off_u, off_v)
            jump = a + b * depth[i, j] * depth[i, j]
            for p, q in ((i, j + 1), (i + 1, j)):
                other = labels[p, q] if p < h and q < w else 0
                if other > 0 and other != k and abs(depth[p, q] - depth[i, j]) < jump:
                    contact[k, other] += 1
                    contact[other, k] += 1
