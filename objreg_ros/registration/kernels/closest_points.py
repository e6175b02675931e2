# SPDX-License-Identifier: Apache-2.0
"""A surface with a grid that knows the closest of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.projection import FAST

MOST_CELLS = 4_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IndexedSurface:
    """Oriented points (N, 3) float32 with a grid that holds, in each cell, which of them is closest (-1: none near)."""

    xyz: Array
    normals: Array
    closest: Array
    low: Array
    cell: float

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def grid(self) -> tuple[Array, Array, Array, Array, float]:
        """The points, their normals and the grid, for the kernels."""
        return self.xyz, self.normals, self.closest, self.low, self.cell


def prepare_surface(xyz: Array, normals: Array, cell: float, reach: float) -> IndexedSurface:
    """A surface whose grid knows the closest point out to ``reach`` m; ``cell`` m grows for a very large cloud."""
    usable = np.abs(normals).sum(axis=1) > 0.5
    xyz, normals = np.ascontiguousarray(xyz[usable], np.float32), np.ascontiguousarray(normals[usable], np.float32)
    if len(xyz) == 0:
        nothing = np.full((1, 1, 1), -1, np.int32)
        return IndexedSurface(xyz=xyz, normals=normals, closest=nothing, low=np.zeros(3, np.float32), cell=cell)
    low, size = xyz.min(axis=0) - reach, np.ptp(xyz, axis=0) + 2.0 * reach
    while np.prod(size / cell + 1.0) > MOST_CELLS:
        cell *= 1.25
    shape = np.ceil(size / cell).astype(np.int64) + 1
    closest = _closest(xyz, low, np.float32(cell), shape, np.float32(reach))
    return IndexedSurface(xyz=xyz, normals=normals, closest=closest, low=low, cell=cell)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _closest(xyz, low, cell, shape, reach):  # type: ignore[no-untyped-def]
    """Fill the grid: every point claims its cell and those next to it, and from there cells hand it on.

    A cell that got a closer point hands it to its six neighbours, as far as ``reach`` goes. Where many points are about
    as close that is not always the closest, but one next to it.
    """
    closest = np.full((shape[0], shape[1], shape[2]), -1, np.int32)
    distance = np.full((shape[0], shape[1], shape[2]), np.float32((reach / cell) ** 2), np.float32)
    places = (xyz - low) / cell - np.float32(0.5)  # in cells, from the middle of the first
    queue, waiting = np.empty((distance.size, 3), np.int32), np.zeros(distance.shape, np.bool_)
    head, count = 0, 0
    for i in range(len(places)):
        a0, b0, c0 = int(places[i, 0] + 0.5), int(places[i, 1] + 0.5), int(places[i, 2] + 0.5)
        for a in range(max(0, a0 - 1), min(shape[0], a0 + 2)):
            for b in range(max(0, b0 - 1), min(shape[1], b0 + 2)):
                for c in range(max(0, c0 - 1), min(shape[2], c0 + 2)):
                    if _claims(i, places, a, b, c, closest, distance) and not waiting[a, b, c]:
                        waiting[a, b, c] = True
                        queue[count, 0], queue[count, 1], queue[count, 2] = a, b, c
                        count += 1
    while count > 0:
        at = queue[head]
        a, b, c = at[0], at[1], at[2]
        head, count = (head + 1) % len(queue), count - 1
        waiting[a, b, c] = False
        i = closest[a, b, c]
        for k in range(6):
            step, axis = 2 * (k % 2) - 1, k // 2
            x, y, z = a + step * (axis == 0), b + step * (axis == 1), c + step * (axis == 2)
            inside = 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]
            if inside and _claims(i, places, x, y, z, closest, distance) and not waiting[x, y, z]:
                waiting[x, y, z] = True
                last = (head + count) % len(queue)
                queue[last, 0], queue[last, 1], queue[last, 2] = x, y, z
                count += 1
    return closest


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _claims(i, places, a, b, c, closest, distance):  # type: ignore[no-untyped-def]
    """Give a cell to a point if it is closer to its middle than the cell's own; whether it is."""
    x, y, z = np.float32(a) - places[i, 0], np.float32(b) - places[i, 1], np.float32(c) - places[i, 2]
    d = x * x + y * y + z * z
    if i == closest[a, b, c] or not d < distance[a, b, c]:
        return False
    closest[a, b, c], distance[a, b, c] = i, d
    return True
