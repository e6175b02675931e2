# SPDX-License-Identifier: Apache-2.0
"""A surface with a grid that knows the closest of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.registration.kernels.projection import FAST

MOST_CELLS = 4_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
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


def prepare_surface(xyz: Array, normals: Array, cell: float, reach: float) -> Surface:
    """A surface whose grid knows the closest point out to ``reach`` m; ``cell`` m grows for a very large cloud."""
    usable = np.abs(normals).sum(axis=1) > 0.5
    xyz, normals = np.ascontiguousarray(xyz[usable], np.float32), np.ascontiguousarray(normals[usable], np.float32)
    if len(xyz) == 0:
        nothing = np.full((1, 1, 1), -1, np.int32)
        return Surface(xyz=xyz, normals=normals, closest=nothing, low=np.zeros(3, np.float32), cell=cell)
    low, size = xyz.min(axis=0) - reach, np.ptp(xyz, axis=0) + 2.0 * reach
    while np.prod(size / cell + 1.0) > MOST_CELLS:
        cell *= 1.25
    shape = np.ceil(size / cell).astype(np.int64) + 1
    closest = _closest(xyz, low, np.float32(cell), shape, np.float32(reach))
    return Surface(xyz=xyz, normals=normals, closest=closest, low=low, cell=cell)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _closest(xyz, low, cell, shape, reach):  # type: ignore[no-untyped-def]
    """Fill the grid: every point claims the cells around it that no other point is closer to."""
    closest = np.full((shape[0], shape[1], shape[2]), -1, np.int32)
    distance = np.full((shape[0], shape[1], shape[2]), np.float32(1e9), np.float32)
    half = np.float32(0.5)
    steps = int(reach / cell)
    most = (reach / cell) ** 2
    for i in range(len(xyz)):
        x, y, z = (xyz[i, 0] - low[0]) / cell, (xyz[i, 1] - low[1]) / cell, (xyz[i, 2] - low[2]) / cell
        a0, b0, c0 = int(x), int(y), int(z)
        for a in range(max(0, a0 - steps), min(shape[0], a0 + steps + 1)):
            da = (a + half - x) ** 2
            for b in range(max(0, b0 - steps), min(shape[1], b0 + steps + 1)):
                db = da + (b + half - y) ** 2
                if db > most:
                    continue
                for c in range(max(0, c0 - steps), min(shape[2], c0 + steps + 1)):
                    d = db + (c + half - z) ** 2
                    if d < distance[a, b, c] and d <= most:
                        distance[a, b, c] = d
                        closest[a, b, c] = i
    return closest
