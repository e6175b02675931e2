# SPDX-License-Identifier: Apache-2.0
"""Which cells around a box are the surface that things stand on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.segmenter.surface.cells import Surface, Window
from objreg_ros.segmenter.surface.level import REACH, support_cells
from objreg_ros.segmenter.surface.support import Ground
from segmenter.scenes import Scene

NOISE = 0.0015
BASE = 0.0005  # metres that are added to the noise


def around(
    scene: Scene, ground: Ground, owner: int, margin: int = 10, pad: float = 0.08
) -> tuple[Surface, Window, np.ndarray]:
    """The cells in and around the box of a thing, the box in cells of the frame, and which thing each cell shows."""
    step, (h, w) = ground.surface.step, ground.surface.depth.shape
    left, top, right, bottom = (round(edge / step) for edge in scene.box_of(owner, pad=pad))
    crop = (max(0, left - margin), max(0, top - margin), min(w, right + margin), min(h, bottom + margin))
    owners = scene.owner[::step, ::step][crop[1] : crop[3], crop[0] : crop[2]]
    return ground.surface.crop(crop), (left, top, right, bottom), owners


def level_shares(
    scene: Scene, owner: int, bend: float = 0.0, base: float = BASE, margin: int = 10, pad: float = 0.08
) -> list[float]:
    """Which share of each thing's cells around a box is level: nothing, the first thing, the second …

    ``bend`` is the error of depth at the left and the right of the image, as a share of it.
    """
    image = scene.image(NOISE)
    warp = 1.0 + bend * np.linspace(-1.0, 1.0, scene.camera.width) ** 2
    ground = scene.ground(replace(image, depth=(image.depth * warp).astype(np.float32)))
    surface, window, owners = around(scene, ground, owner, margin, pad)
    level, found = support_cells(surface, window, ground, base)
    assert level.shape == surface.depth.shape
    assert found == level.any()
    return [float(level[owners == k].mean()) if (owners == k).any() else 0.0 for k in range(scene.count + 1)]


def test_the_table_around_a_box_is_level_and_the_box_is_not() -> None:
    _, table, box = level_shares(Scene().plane().box((-0.1, -0.1, 0), (0.1, 0.1, 0.15)), 2)
    assert table > 0.95
    assert box < 0.1  # its foot


@pytest.mark.parametrize("bend", [0.0, 0.02])
def test_a_thin_book_is_distinguished_from_its_table_even_where_depth_is_bent(bend: float) -> None:
    scene = Scene(tilt_deg=60).plane().box((0.25, 0.1, 0), (0.45, 0.3, 0.008))
    _, table, book = level_shares(scene, 2, bend)
    assert table > 0.9
    assert book < 0.1


def test_a_large_level_top_is_the_object_s_own_where_its_table_is_seen_around_it() -> None:
    scene = Scene(tilt_deg=50).plane().box((-0.15, -0.15, 0), (0.15, 0.15, 0.1))
    assert len(scene.ground(scene.image(NOISE)).supports) == 2  # the top is one of them
    _, table, box = level_shares(scene, 2)
    assert table > 0.95
    assert box < 0.1


@pytest.mark.parametrize("height", [0.03, 0.05])
@pytest.mark.parametrize("tilt_deg", [50, 60, 70])
def test_a_low_top_that_fills_its_box_is_the_object_s_own_where_its_table_is_seen_around_it(
    height: float, tilt_deg: float
) -> None:
    scene = Scene(tilt_deg=tilt_deg).plane().box((-0.1, -0.075, 0), (0.1, 0.075, height))
    _, table, box = level_shares(scene, 2, pad=0.0)
    assert table > 0.9
    assert box < 0.1


def test_a_shelf_with_a_box_is_level_and_so_is_the_floor_below_it_but_not_its_side() -> None:
    scene = Scene(tilt_deg=40).plane().box((-0.3, 0.02, 0), (0.3, 0.4, 0.058)).plane(0.06, (-0.3, 0.3), (0.0, 0.4))
    scene.box((-0.05, 0.02, 0.06), (0.05, 0.1, 0.16))
    _, floor, side, shelf, box = level_shares(scene, 4, margin=20)
    assert min(floor, shelf) > 0.9
    assert side < 0.3  # its foot
    assert box < 0.1


@pytest.mark.parametrize(("floor", "is_level"), [(False, True), (True, False)])
def test_a_plate_that_fills_its_box_is_level_unless_something_is_seen_below_it(floor: bool, is_level: bool) -> None:
    scene = Scene(tilt_deg=40).plane(0.0, (-0.2, 0.2), (-0.2, 0.2))
    if floor:
        scene.plane(-0.15, (-0.3, 0.3), (-0.1, 0.9))
    plate = level_shares(scene, 1)[1]
    assert plate > 0.95 if is_level else plate < 0.05


def test_a_piece_of_a_table_is_no_top_where_more_of_the_table_is_seen_around_its_box() -> None:
    scene = Scene(tilt_deg=50).plane(0.0, (-0.4, -0.05), (-0.2, 0.2)).plane(0.0, (0.0, 0.1), (-0.2, 0.2))
    scene.plane(-0.2, (0.05, 0.6), (-0.3, 0.6))
    assert level_shares(scene, 2, margin=60)[2] > 0.95
    assert level_shares(scene, 2, margin=4)[2] < 0.05


def test_the_height_that_is_asked_for_is_added_to_the_noise() -> None:
    scene = Scene(tilt_deg=60).plane().box((-0.02, -0.02, 0), (0.02, 0.02, 0.02))
    assert level_shares(scene, 2, base=0.0)[2] < 0.15
    assert level_shares(scene, 2, base=0.03)[2] > 0.95


def test_a_support_goes_on_a_little_beyond_where_it_was_found_and_no_farther() -> None:
    scene = Scene().plane()
    image = scene.image(NOISE)
    ground = scene.ground(image)
    (table,) = ground.supports
    parts = table.parts.copy()
    parts[:, 81:] = 0  # coarse cells; the table goes on
    ground = replace(ground, supports=[replace(table, parts=parts, total=np.bincount(parts.ravel()))])
    crop = (120, 80, 220, 160)
    level, _ = support_cells(ground.surface.crop(crop), (140, 100, 180, 140), ground, 0.01)
    columns = np.flatnonzero(level.mean(axis=0) > 0.9) + crop[0]
    assert columns.tolist() == list(range(120, 2 * (81 + REACH)))
    assert not level[:, columns.max() - crop[0] + 1 :].any()


def test_cells_without_depth_are_never_level() -> None:
    scene = Scene().plane().box((-0.1, -0.1, 0), (0.1, 0.1, 0.15))
    ground = scene.ground(scene.image(NOISE))
    surface, window, owners = around(scene, ground, 2)
    surface.depth[:6] = 0
    level, found = support_cells(surface, window, ground, 9.0)
    assert found
    assert not level[:6].any()
    assert level[6:][owners[6:] == 1].all()


def test_a_support_far_from_the_box_is_none_of_its() -> None:
    scene = Scene().plane(0.0, (-0.6, -0.3), (-0.2, 0.2)).box((0.2, 0, 0), (0.3, 0.1, 0.1))
    ground = scene.ground(scene.image(NOISE))
    assert len(ground.supports) == 1
    surface, window, _ = around(scene, ground, 2)
    level, found = support_cells(surface, window, ground, BASE)
    assert not found
    assert not level.any()


@pytest.mark.parametrize("change", [{"up": None}, {"supports": []}])
def test_without_gravity_or_a_support_nothing_is_level(change: dict) -> None:
    scene = Scene().plane().box((-0.1, -0.1, 0), (0.1, 0.1, 0.15))
    ground = scene.ground(scene.image(NOISE))
    surface, window, _ = around(scene, ground, 2)
    level, found = support_cells(surface, window, replace(ground, **change), BASE)
    assert not found
    assert level.shape == surface.depth.shape
    assert not level.any()


def test_on_the_coarse_grid_the_same_is_level() -> None:
    scene = Scene().plane().box((-0.3, -0.2, 0), (0.3, 0.2, 0.2))
    ground = scene.ground(scene.image(NOISE))
    level, found = support_cells(ground.coarse, (30, 30, 130, 100), ground, BASE)
    owners = scene.owner[::4, ::4]
    assert found
    assert level[owners == 1].mean() > 0.95
    assert level[owners == 2].mean() < 0.1
