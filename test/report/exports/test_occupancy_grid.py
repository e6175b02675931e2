# SPDX-License-Identifier: Apache-2.0
"""A flat of known walls as a grid: walls where they are, openings free."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.exports.occupancy_grid import FREE, OCCUPIED, UNKNOWN, GridMaker, GridParams, OccupancyGrid
from report.exports.drawn_flat import BOXES, looking, see, walk


def made(boxes: np.ndarray = BOXES, noise: float = 0.0, floor: float = 0.0, **params: float) -> OccupancyGrid:
    poses = walk()
    maker = GridMaker(np.array([T[:3, 3] for T in poses]), floor, GridParams(**params))
    for T in poses:
        maker.add_view(T, see(T, boxes, noise))
    return maker.grid()


@pytest.fixture(scope="module")
def flat() -> OccupancyGrid:
    return made()


def at(grid: OccupancyGrid, x: float, y: float) -> int:
    column, row = ((np.array([x, y]) - grid.origin) / grid.cell).astype(int)
    inside = 0 <= row < grid.cells.shape[0] and 0 <= column < grid.cells.shape[1]
    return int(grid.cells[row, column]) if inside else UNKNOWN


def values(grid: OccupancyGrid, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
    return np.array([at(grid, x, y) for x, y in zip(*np.broadcast_arrays(xs, ys), strict=True)])


def test_walls_are_where_they_are(flat: OccupancyGrid) -> None:
    inner = np.arange(0.3, 2.8, 0.05)
    for xs, ys in ((-0.025, inner), (4.025, inner[:15]), (inner, -0.025), (np.arange(2.2, 3.8, 0.05), 3.025)):
        assert (values(flat, xs, ys) == OCCUPIED).mean() > 0.95
    assert flat.cells.shape == (pytest.approx(6.0 / 0.05, abs=4), pytest.approx(4.0 / 0.05, abs=4))


@pytest.mark.parametrize("times", range(1, 40))
def test_what_is_as_likely_free_as_occupied_is_unknown(times: int) -> None:
    maker = GridMaker(np.zeros((1, 3)), 0.0, GridParams())
    maker._hits[:], maker._passes[:] = 8 * times, 17 * times
    maker._passes[0, 0], maker._hits[1, 1, 0] = 17 * times + 1, 8 * times + 1
    cells = maker.grid().cells
    assert cells.shape == (2, 2) and cells.tolist() == [[FREE, UNKNOWN], [UNKNOWN, OCCUPIED]]


def test_the_opening_between_two_rooms_is_free(flat: OccupancyGrid) -> None:
    xs, ys = np.meshgrid(np.arange(1.1, 1.9, 0.05), np.arange(2.5, 3.6, 0.05))
    assert (values(flat, xs.ravel(), ys.ravel()) == FREE).all()


def test_the_rooms_are_free_and_what_is_behind_walls_is_unknown(flat: OccupancyGrid) -> None:
    xs, ys = np.meshgrid(np.arange(0.3, 2.9, 0.05), np.arange(0.3, 2.8, 0.05))
    assert (values(flat, xs.ravel(), ys.ravel()) == FREE).mean() > 0.99
    assert {at(flat, -0.5, 1.0), at(flat, 4.5, 1.0), at(flat, 2.0, 7.0)} == {UNKNOWN}


def test_a_table_is_in_the_way_though_rays_pass_above_and_below(flat: OccupancyGrid) -> None:
    xs, ys = np.meshgrid(np.arange(3.3, 3.9, 0.05), np.arange(1.3, 1.7, 0.05))
    assert (values(flat, xs.ravel(), ys.ravel()) == OCCUPIED).mean() > 0.95
    low = made(high=0.6)
    assert (values(low, xs.ravel(), ys.ravel()) != OCCUPIED).all()


def test_noise_of_a_kinect_leaves_the_walls_and_the_opening() -> None:
    grid = made(noise=0.003)
    xs, ys = np.meshgrid(np.arange(1.15, 1.9, 0.05), np.arange(2.5, 3.6, 0.05))
    assert (values(grid, xs.ravel(), ys.ravel()) == FREE).all()
    assert (values(grid, np.arange(0.3, 2.8, 0.05), -0.025) == OCCUPIED).mean() > 0.8


def test_a_hole_in_the_floor_is_not_free() -> None:
    pit = np.array([[[-9, -9, -0.1], [1.8, 9, 0]], [[2.6, -9, -0.1], [9, 9, 0]], [[-9, -9, -1], [9, 9, -0.9]]])
    ends = np.array([[[1.8, -9, -0.1], [2.6, 0.4, 0]], [[1.8, 1.2, -0.1], [2.6, 9, 0]]])
    grid = made(np.concatenate([BOXES[:-1], pit, ends]))
    xs, ys = np.meshgrid(np.arange(1.95, 2.5, 0.05), np.arange(0.55, 1.1, 0.05))
    assert (values(grid, xs.ravel(), ys.ravel()) != FREE).mean() > 0.9
    assert at(grid, 1.0, 1.0) == FREE


def test_a_map_that_is_too_large_has_larger_cells() -> None:
    cameras = np.array([[0.0, 0.0, 1.3], [100.0, 0.0, 1.3]])
    maker = GridMaker(cameras, 0.0, GridParams(), most=1_000_000)
    maker.add_view(looking(0.0, 0.0, 90.0), see(looking(1.5, 1.0, 90.0)))
    assert maker.cell == 0.2 and maker.grid().cell == 0.2


def test_a_grid_of_nothing_is_one_unknown_cell() -> None:
    grid = GridMaker(np.zeros((1, 3)), 0.0, GridParams()).grid()
    assert grid.cells.tolist() == [[UNKNOWN]]


@pytest.mark.parametrize(
    ("params", "why"), [({"cell": 0.0}, "--cell"), ({"low": 0.0}, "--band"), ({"low": 2.0}, "--band")]
)
def test_cells_and_bands_that_are_none_are_refused(params: dict[str, float], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        GridParams(**params)
