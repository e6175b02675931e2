# SPDX-License-Identifier: Apache-2.0
"""What of a level map a robot may drive through, by rays through the depth of its views.

As in OctoMap (Hornung et al., 2013): of each voxel is counted in how many views a surface lies in it, and in how many
rays pass through it. A cell is the column of its voxels over a band of heights above the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import transform
from objreg_ros.sensor import depth_noise, depth_sigma

CELL_M = 0.05
BAND_M = (0.1, 1.5)  # above the floor: from what a small wheel climbs to the top of a service robot
LEAST_CELL_M, MOST_CELL_M = 0.01, 1.0
LAYER_M = 0.1
DEEPEST_M = 100.0  # below the floor
REACH_M = 6.0  # what is farther away than this is not used
MOST_VOXELS = 40_000_000  # of 4 bytes; at 5 cm and with the usual band 85 m by 85 m
HIT, PASS = 17, 8  # log-odds, OctoMap's 0.85 and 0.4, in twentieths: whole, so that what is even is so in any numpy
TILT = 0.0175  # m by which a height errs for each m of distance: a degree
SIGMAS = 3.0  # of depth that a ray ends before the surface
JUMP = 0.05  # share of its depth by which a neighbour differs at an edge: points there hang in the air
RAYS = 80  # columns of a view whose rays are cast
STEP = 0.7  # of a cell, along a ray
EDGE = 7  # cells: a ray into a pit passes its edge so far from where it is below the floor
UNKNOWN, FREE, OCCUPIED = -1, 0, 100  # as in nav_msgs/OccupancyGrid


@dataclass(frozen=True, slots=True)
class GridParams:
    """The side of a ``cell`` and the heights above the floor between which something is in the way, m.

    ValueError where they are none.
    """

    cell: float = CELL_M
    low: float = BAND_M[0]
    high: float = BAND_M[1]

    def __post_init__(self) -> None:
        if not LEAST_CELL_M <= self.cell <= MOST_CELL_M:
            raise ValueError(f"--cell: expected {LEAST_CELL_M:g} to {MOST_CELL_M:g} m, got {self.cell:g}")
        if not 0.0 < self.low < self.high <= 10.0:
            raise ValueError(f"--band: expected 0 < LOW < HIGH <= 10 m, got {self.low:g} {self.high:g}")


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """``cells (H, W) int8``: -1 unknown, 0 free, 100 occupied; row 0 has the least y, column 0 the least x.

    ``origin`` x y m is the corner of the cell 0 0, ``cell`` m the side of one.
    """

    cells: Array
    origin: tuple[float, float]
    cell: float


class GridMaker:
    """Collects views of a level map. Cells double where the map is so large that there were too many of them."""

    def __init__(self, cameras: Array, floor: float, params: GridParams, most: int = MOST_VOXELS) -> None:
        """``cameras (N, 3)`` m are where views will be taken from, N >= 1; ``floor`` m is its height."""
        self._floor, self._params = floor, params
        self._layers = max(1, round((params.high - params.low) / LAYER_M))
        self.cell = params.cell
        low, high = cameras[:, :2].min(axis=0) - REACH_M, cameras[:, :2].max(axis=0) + REACH_M
        while float(np.prod((high - low) / self.cell + 2.0)) * self._layers > most:
            self.cell *= 2.0
        self._corner = np.floor(low / self.cell).astype(np.int64)  # in cells
        width, height = (np.ceil(high / self.cell).astype(np.int64) - self._corner + 1).tolist()
        self._hits, self._passes = (np.zeros((height, width, self._layers), np.uint16) for _ in range(2))
        self._floors, self._drops = (np.zeros((height, width), np.uint16) for _ in range(2))

    def add_view(self, T_level_camera: Array, view: View) -> None:
        """Count what a view shows, from one of the places of the cameras."""
        xyz = view.xyz.astype(float)
        camera, points = T_level_camera[:3, 3], transform(T_level_camera, xyz)
        depth = xyz[..., 2]
        sigma = depth_sigma(depth, depth_noise(np.nan_to_num(view.xyz[..., 2])))
        distance = np.linalg.norm(xyz, axis=-1)
        seen = np.isfinite(depth) & ~_at_edges(depth)
        window = _Window(self._corner, self._hits.shape, camera, self.cell)
        near = seen & (sigma <= self.cell) & (distance <= REACH_M)
        hits, floors = self._surfaces(window, points[near], distance[near])
        every = max(1, view.xyz.shape[1] // RAYS)
        few = np.s_[every // 2 :: every, every // 2 :: every]
        cast = seen[few]
        ends = 1.0 - (SIGMAS * sigma[few][cast] + self.cell) / np.maximum(depth[few][cast], 1e-6)
        ends = np.minimum(ends, REACH_M / distance[few][cast])
        rays = points[few][cast] - camera
        passes = self._cast(window, camera, rays, ends, (self._params.low, self._params.high))
        below = camera[2] + ends * rays[:, 2] - self._floor < -self._margin(distance[few][cast])
        drops = self._cast(window, camera, rays[below], ends[below], (-DEEPEST_M, -self._params.low))
        passes &= ~hits
        for counts, mask in (
            (self._hits, hits),
            (self._passes, passes),
            (self._floors, floors[..., 0]),
            (self._drops, drops.any(axis=2)),
        ):
            part = counts[window.rows, window.columns]
            np.add(part, 1, out=part, where=mask & (part < np.iinfo(np.uint16).max))

    def grid(self) -> OccupancyGrid:
        """What is known, cut to where that is; one unknown cell where nothing is.

        A cell is occupied where any voxel of it is. It is free where the floor is seen, or where rays pass through the
        lowest voxel and half of all: those above a worktop say nothing of what is below it. Where more views see below
        the floor than see it, as over stairs, it is not free, nor beside that where no floor is seen.
        """
        evidence = HIT * self._hits.astype(np.int32) - PASS * self._passes.astype(np.int32)
        occupied = ((self._hits > 0) & (evidence > 0)).any(axis=2)
        through = (self._passes > 0) & (evidence < 0)
        clear = through[..., 0] & (2 * through.sum(axis=2) >= self._layers)
        pits = self._drops > self._floors
        beside = cv2.dilate(pits.astype(np.uint8), np.ones((EDGE, EDGE), np.uint8)) > 0
        free = ((self._floors > 0) & ~pits) | (clear & ~beside)
        cells = np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.int8)
        rows, columns = (np.flatnonzero((cells != UNKNOWN).any(axis=axis)) for axis in (1, 0))
        first_row, first_column = (int(k[0]) if len(k) else 0 for k in (rows, columns))
        last_row, last_column = (int(k[-1]) + 1 if len(k) else 1 for k in (rows, columns))
        x, y = ((self._corner + np.array([first_column, first_row])) * self.cell).tolist()
        return OccupancyGrid(cells[first_row:last_row, first_column:last_column], (x, y), self.cell)

    def _margin(self, distance: Array) -> Array:
        """How far from the floor what is of the floor may seem to lie, m."""
        return np.asarray(self._params.low + TILT * distance)

    def _surfaces(self, window: _Window, points: Array, distance: Array) -> tuple[Array, Array]:
        """The voxels with something in the way, and the cells (…, 1) with floor."""
        height, margin = points[:, 2] - self._floor, self._margin(distance)
        hits, floors = window.mask(self._layers), window.mask(1)
        blocks, floor = (height > margin) & (height < self._params.high), np.abs(height) <= margin
        window.mark(hits, points[blocks], self._layer(height[blocks]))
        window.mark(floors, points[floor], np.zeros(int(floor.sum()), np.int64))
        return hits, floors

    def _cast(self, window: _Window, camera: Array, rays: Array, ends: Array, band: tuple[float, float]) -> Array:
        """The voxels of rays (N, 3) from the camera to that share (N,) of them, in the band."""
        low, high = (self._floor + height - camera[2] for height in band)
        rise = np.where(np.abs(rays[:, 2]) < 1e-9, 1e-9, rays[:, 2])
        bounds = np.sort(np.stack([low / rise, high / rise]), axis=0)
        start, stop = np.maximum(bounds[0], 0.0), np.minimum(bounds[1], ends)
        step = STEP * self.cell / np.maximum(np.linalg.norm(rays, axis=1), 1e-6)
        at, passes = start + 0.5 * step, window.mask(self._layers)
        while (going := at < stop).any():
            rays, at, stop, step = rays[going], at[going], stop[going], step[going]
            points = camera + at[:, None] * rays
            window.mark(passes, points, self._layer(points[:, 2] - self._floor))
            at = at + step
        return passes

    def _layer(self, height: Array) -> Array:
        params = self._params
        layer = np.floor((height - params.low) * (self._layers / (params.high - params.low))).astype(np.int64)
        return np.clip(layer, 0, self._layers - 1)


class _Window:
    """The part of a grid around a camera: one view reaches no farther."""

    def __init__(self, corner: Array, shape: tuple[int, ...], camera: Array, cell: float) -> None:
        self._cell = cell
        low = np.floor((camera[:2] - REACH_M) / cell).astype(np.int64) - corner
        high = np.ceil((camera[:2] + REACH_M) / cell).astype(np.int64) - corner + 1
        (first_x, first_y), (last_x, last_y) = (np.clip(side, 0, shape[1::-1]).tolist() for side in (low, high))
        self.rows, self.columns = slice(first_y, last_y), slice(first_x, last_x)
        self._first = corner + np.array([first_x, first_y])

    def mask(self, layers: int) -> Array:
        """Nothing is marked yet: (rows, columns, layers)."""
        return np.zeros((self.rows.stop - self.rows.start, self.columns.stop - self.columns.start, layers), bool)

    def mark(self, mask: Array, points: Array, layers: Array) -> None:
        """Mark the voxels of points (N, 3) m in these layers (N,); those outside are left out."""
        x, y = (np.floor(points[:, :2] / self._cell).astype(np.int64) - self._first).T
        inside = (x >= 0) & (y >= 0) & (x < mask.shape[1]) & (y < mask.shape[0])
        mask[y[inside], x[inside], layers[inside]] = True


def _at_edges(depth: Array) -> Array:
    """Whether a pixel of (h, w) m has a neighbour along its row or column that is much nearer or farther."""
    edges = np.zeros(depth.shape, bool)
    for along, marked in ((depth, edges), (depth.T, edges.T)):
        jumps = np.abs(np.diff(along, axis=0)) > JUMP * np.minimum(along[1:], along[:-1])
        marked[1:] |= jumps
        marked[:-1] |= jumps
    return edges
