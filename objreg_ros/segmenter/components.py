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
