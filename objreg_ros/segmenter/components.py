# SPDX-License-Identifier: Apache-2.0
"""Connected parts of a surface: cells that touch without a depth jump between them.

Union-find over the cells (Rosenfeld and Pfaltz, "Sequential operations in digital picture processing", 1966), with
links that reach over small holes in the depth.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.surface import EXACT


def connect(depth: Array, keep: Array, jump: tuple[float, float]) -> tuple[Array, int]:
    """The parts of the cells ``keep (h, w) bool``: labels (h, w) int32, 0 where not kept, else 1 … count; and count.

    Neighbours are linked where their ``depth (h, w)`` differs by less than a + b z² of ``jump`` = (a, b); so are cells
    with one cell without depth between them.
    """
    labels = np.empty(depth.shape, np.int32)
    count = _connect(depth, keep, np.float32(jump[0]), np.float32(jump[1]), labels)
    return labels, int(count)


@numba.njit(cache=True, inline="always")
def _root(parent, k):  # type: ignore[no-untyped-def]
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@numba.njit(cache=True, inline="always")
def _join(parent, k, other):  # type: ignore[no-untyped-def]
    r, s = _root(parent, k), _root(parent, other)
    parent[max(r, s)] = min(r, s)


@numba.njit(cache=True, fastmath=EXACT)
def _connect(depth, keep, a, b, labels):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    parent = np.empty(h * w, np.int32)
    for i in range(h):
        for j in range(w):
            k = np.int32(i * w + j)
            parent[k] = k
            if not keep[i, j]:
                continue
            z = depth[i, j]
            jump = a + b * z * z
            back = 2 if j > 1 and depth[i, j - 1] == 0 else 1
            if j >= back and keep[i, j - back] and abs(depth[i, j - back] - z) < jump:
                parent[k] = _root(parent, np.int32(k - back))
            back = 2 if i > 1 and depth[i - 1, j] == 0 else 1
            if i >= back and keep[i - back, j] and abs(depth[i - back, j] - z) < jump:
                _join(parent, k, np.int32(k - back * w))
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
        for v, u, name in cells:
            labels[v, u] = name
