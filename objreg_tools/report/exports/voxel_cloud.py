# SPDX-License-Identifier: Apache-2.0
"""Points of many keyframes, one for each voxel, in no more memory than a few hundred megabytes."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform

VOXEL_M = 0.02  # finer than what a depth camera errs by at 2 m
MOST_POINTS = 1_000_000  # of 64 bytes: to merge them takes 300 MB; at 2 cm they cover some 300 m^2
BATCH = 250_000  # points that are taken before they are merged
LEAST_VOXEL_M, MOST_VOXEL_M = 1e-3, 10.0
UNKNOWN_GREY = 128
XYZ, POINTS, RGB, SURE = slice(0, 3), slice(3, 4), slice(4, 7), slice(7, 8)  # the columns of a row


class VoxelCloud:
    """The mean point and the mean colour of each voxel. Voxels double where there are more than ``most`` of them.

    ``voxel`` is the side that they have now, m; ValueError unless it is of 1 mm to 10 m.
    """

    def __init__(self, voxel: float, most: int = MOST_POINTS) -> None:
        require_voxel(voxel)
        self.voxel, self._most = voxel, most
        self._rows, self._new, self._waiting = np.zeros((0, 8)), list[Array](), 0

    def add_points(self, T_map_camera: Array, xyz: Array, rgb: Array | None = None, sureness: float = 1.0) -> None:
        """Take points (..., 3) m of a camera, with colours (..., 3) 0..255; those that are not finite are left out.

        A colour counts by its ``sureness`` in the mean of its voxel.
        """
        xyz = xyz.reshape(-1, 3)
        rgb = None if rgb is None else rgb.reshape(-1, 3)
        for start in range(0, len(xyz), BATCH):
            part = slice(start, start + BATCH)
            self._take(T_map_camera, xyz[part], None if rgb is None else rgb[part], sureness)

    def points(self) -> tuple[Array, Array | None]:
        """``xyz (N, 3) float64`` m of the map and ``rgb (N, 3) uint8``, None where no point came with a colour."""
        self._merge()
        sure = self._rows[:, SURE] > 0
        if not sure.any():
            return self._rows[:, XYZ], None
        return self._rows[:, XYZ], np.where(sure, np.rint(self._rows[:, RGB]), UNKNOWN_GREY).astype(np.uint8)

    def _take(self, T_map_camera: Array, xyz: Array, rgb: Array | None, sureness: float) -> None:
        known = np.isfinite(xyz).all(axis=1)
        rows = np.zeros((int(known.sum()), 8))
        rows[:, XYZ], rows[:, POINTS] = transform(T_map_camera, xyz[known].astype(float)), 1.0
        if rgb is not None:
            rows[:, RGB], rows[:, SURE] = rgb[known], sureness
        rows = thinned(rows, self.voxel)
        if self._waiting + len(rows) > BATCH:
            self._merge()
        self._new.append(rows)
        self._waiting += len(rows)

    def _merge(self) -> None:
        self._rows = np.concatenate([self._rows, *self._new])
        self._new, self._waiting = [], 0
        self._rows = thinned(self._rows, self.voxel)
        while len(self._rows) > self._most:
            self.voxel *= 2.0
            self._rows = thinned(self._rows, self.voxel)


def require_voxel(voxel: float) -> None:
    """ValueError unless a voxel has a side of 1 mm to 10 m."""
    if not LEAST_VOXEL_M <= voxel <= MOST_VOXEL_M:
        raise ValueError(f"expected voxels of {LEAST_VOXEL_M:g} to {MOST_VOXEL_M:g} m, got {voxel:g}")


def thinned(rows: Array, voxel: float) -> Array:
    """One row for each occupied voxel, in the order of the voxels: the means by how many points and colours count."""
    if len(rows) == 0:
        return rows
    cells = np.floor(rows[:, XYZ] / voxel).astype(np.int64)  # three numbers: one of 64 bits holds no odometry in UTM
    order = np.lexsort(cells.T)
    cells = cells[order]
    starts = np.flatnonzero(np.concatenate([[True], (np.diff(cells, axis=0) != 0).any(axis=1)]))
    sums = rows[order]
    sums[:, XYZ] -= cells * voxel  # from the corner of the voxel: sums of what is far away would lose digits
    sums[:, XYZ] *= sums[:, POINTS]
    sums[:, RGB] *= sums[:, SURE]
    means = np.add.reduceat(sums, starts, axis=0)
    means[:, XYZ] = means[:, XYZ] / means[:, POINTS] + cells[starts] * voxel
    means[:, RGB] /= np.maximum(means[:, SURE], np.finfo(float).tiny)
    return np.asarray(means)
