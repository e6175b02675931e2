# SPDX-License-Identifier: Apache-2.0
"""Connected parts of a surface: cells that touch without a depth jump between them.

Union-find over the cells (Rosenfeld and Pfaltz, "Sequential operations in digital picture processing", 1966), with
links that reach over small holes in the depth.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import EXACT


def connect(depth: Array, keep: Array, jump: tuple[float, float]) -> tuple[Array, int]:
    """The parts of the cells ``keep (h, w) bool``: labels (h, w) int32, 0 where not kept, else 1 … count; and count.

    Neighbours are linked where their ``depth (h, w)`` differs by less than a + b z² of ``jump`` = (a, b); so are cells
    with one cell without depth between them.
    """
    labels = np.empty(depth.shape, np.int32)
    count = _connect(depth, keep, np.float32(jump[0]), np.float32(jump[1]), 1, labels)
    return labels, int(count)


@numba.njit(cache=True, nogil=True, inline="always")
def _root(parent, k):  # type: ignore[no-untyped-def]
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@numba.njit(cache=True, nogil=True)
def _join(parent, k, other):  # type: ignore[no-untyped-def]
    r, s = _root(parent, k), _root(parent, other)
    parent[max(r, s)] = min(r, s)


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _connect(depth, keep, a, b, least, labels):  # type: ignore[no-untyped-def]
    """Fill ``labels``: first with runs, the linked cells of a row; runs of two rows are joined where they touch."""
    h, w = depth.shape
    parent, size = np.empty(h * w + 1, np.int32), np.empty(h * w + 1, np.int32)
    parent[0] = size[0] = 0
    runs = np.int32(0)
    for i in range(h):
        joined, joined_above = np.int32(0), np.int32(0)
        for j in range(w):
            labels[i, j] = 0
            if not keep[i, j]:
                continue
            z = depth[i, j]
            jump = a + b * z * z
            back = 2 if j > 1 and depth[i, j - 1] == 0 else 1
            if j >= back and keep[i, j - back] and abs(depth[i, j - back] - z) < jump:
                run = labels[i, j - back]
            else:
                runs += 1
                run = runs
                parent[run] = run
                size[run] = 0
            size[run] += 1
            labels[i, j] = run
            back = 2 if i > 1 and depth[i - 1, j] == 0 else 1
            if i >= back and keep[i - back, j] and abs(depth[i - back, j] - z) < jump:
                above = labels[i - back, j]
                if above != joined_above or run != joined:
                    _join(parent, run, above)
                    joined, joined_above = run, above
    return _number(parent[: runs + 1], size[: runs + 1], least, labels)


@numba.njit(cache=True, nogil=True)
def _number(parent, size, least, labels):  # type: ignore[no-untyped-def]
    """Turn the runs in ``labels`` into parts of ``least`` cells or more, 1 … count by their first cells."""
    number = np.zeros(len(parent), np.int32)
    for run in range(len(parent) - 1, 0, -1):
        if parent[run] != run:
            size[_root(parent, run)] += size[run]
    count = 0
    for run in range(1, len(parent)):
        root = _root(parent, run)
        if root == run and size[run] >= least:  # a root is the first run of its part, so it is met before the others
            count += 1
            number[run] = count
        elif root != run:
            number[run] = number[root]
    for i in range(labels.shape[0]):
        row = labels[i]
        for j in range(len(row)):
            row[j] = number[row[j]]
    return count


def split(
    depth: Array, level: Array, seams: Array, jump: tuple[float, float], least: int, rounds: int
) -> tuple[Array, int]:
    """The parts of the cells with depth that are not ``level (h, w) bool``, parted at ``seams (h, w) bool``.

    Parts of fewer than ``least`` cells are dissolved; the others grow over those cells and over seams, one ring of
    cells in each of ``rounds``.
    Labels (h, w) int32, 0 for none, and their number.
    """
    labels = np.empty(depth.shape, np.int32)
    a, b = np.float32(jump[0]), np.float32(jump[1])
    return labels, int(_split(depth, level, seams, a, b, least, rounds, labels))


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _split(depth, level, seams, a, b, least, rounds, labels):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    keep, solid = np.empty((h, w), np.bool_), np.empty((h, w), np.bool_)
    for i in range(h):
        for j in range(w):
            keep[i, j] = (depth[i, j] > 0) & (not level[i, j])
            solid[i, j] = keep[i, j] & (not seams[i, j])
    count = _connect(depth, solid, a, b, least, labels)
    _grow(labels, depth, keep, a, b, rounds)
    return count


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _grow(labels, depth, keep, a, b, rounds):  # type: ignore[no-untyped-def]
    """Let the parts grow in place into the cells of ``keep`` that have no label, one ring of cells a round.

    A cell takes the label of the neighbour nearest in depth; where two parts grow towards each other they meet half
    way.
    """
    h, w = depth.shape
    bare = np.empty((h * w, 3), np.int64)  # rows and columns of the cells without a label, and the label found
    n = 0
    for i in range(h):
        for j in range(w):
            if keep[i, j] and labels[i, j] == 0:
                bare[n, 0], bare[n, 1] = i, j
                n += 1
    for _ in range(rounds):
        for k in range(n):
            bare[k, 2] = _nearest_label(labels, depth, bare[k, 0], bare[k, 1], a, b)
        left = 0
        for k in range(n):
            labels[bare[k, 0], bare[k, 1]] = bare[k, 2]
            if bare[k, 2] == 0:
                bare[left, 0], bare[left, 1] = bare[k, 0], bare[k, 1]
                left += 1
        if left == n:
            return
        n = left


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _nearest_label(labels, depth, i, j, a, b):  # type: ignore[no-untyped-def]
    """The label of the neighbour of cell (i, j) that is nearest in depth; 0 if none is within a depth jump."""
    z = depth[i, j]
    nearest = a + b * z * z
    label = np.int32(0)
    for p, q in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
        if p >= 0 and q >= 0 and p < depth.shape[0] and q < depth.shape[1] and labels[p, q] > 0:
            step = abs(depth[p, q] - z)
            if step < nearest:
                nearest = step
                label = labels[p, q]
    return label
