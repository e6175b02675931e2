# SPDX-License-Identifier: Apache-2.0
"""A surface with a grid that knows the closest of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("closest_points")
MOST_CELLS = 4_000_000
NO_POINT = 65535  # in a cell that no point is near; two bytes a cell, since grids are most of a prepared keyframe


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IndexedSurface:
    """Oriented points (N, 3) float32 with a grid that holds, in each cell, which of them is closest.

    N is at most `NO_POINT`, which is what a cell holds that none is near.
    """

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
    """A surface whose grid knows the closest point out to ``reach`` m; ``cell`` m grows for a very large cloud.

    Of more than `NO_POINT` points it keeps so many, evenly.
    """
    usable = np.flatnonzero(np.abs(normals).sum(axis=1) > 0.5)
    if len(usable) > NO_POINT:
        usable = usable[np.linspace(0, len(usable) - 1, NO_POINT).astype(np.int64)]
    xyz, normals = np.ascontiguousarray(xyz[usable], np.float32), np.ascontiguousarray(normals[usable], np.float32)
    if len(xyz) == 0:
        nothing = np.full((1, 1, 1), NO_POINT, np.uint16)
        return IndexedSurface(xyz=xyz, normals=normals, closest=nothing, low=np.zeros(3, np.float32), cell=cell)
    low, size = xyz.min(axis=0) - reach, np.ptp(xyz, axis=0) + 2.0 * reach
    while np.prod(size / cell + 1.0) > MOST_CELLS:
        cell *= 1.25
    shape = np.ceil(size / cell).astype(np.int64) + 1
    closest = _KERNELS.closest(xyz, low, cell, shape, reach)
    return IndexedSurface(xyz=xyz, normals=normals, closest=closest, low=low, cell=cell)
