# SPDX-License-Identifier: Apache-2.0
"""What cuts an object, and what is a patch of a wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.objects.extract import Pixels
from objreg_ros.segmenter.objects.flags import _KERNELS, MIN_CELLS, whole_flags
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.surface.cells import Window
from segmenter.scenes import SMALL, Scene, two_boxes

NOISE = 0.0015
INSIDE = (100, 100, 200, 200)  # pixels that are far from every border


def pixels_within(bounds: Box, count: int = 1) -> Pixels:
    """So many pixels somewhere in ``bounds``."""
    points = np.ones((count, 3), np.float32)
    return Pixels(points, points, None, np.zeros(count, np.uint16), 1.0, bounds)


def flags_of(scene: Scene, chosen: np.ndarray, box: Window, pixels: Pixels | None = None) -> PointFlag:
    """The flags of the chosen cells of a whole image, which lie in the middle of it if nothing else is said."""
    image = scene.image(NOISE)
    some = pixels_within(INSIDE) if pixels is None else pixels
    return whole_flags(image, some, scene.ground(image).surface, chosen, box)


def chosen_cells(window: Window) -> np.ndarray:
    """(240, 320) bool: all cells of a window."""
    chosen = np.zeros((SMALL.height, SMALL.width), bool)
    chosen[window[1] : window[3], window[0] : window[2]] = True
    return chosen


def wall() -> Scene:
    """A wall in front of the camera, as small as an image of one pixel a cell."""
    return Scene(SMALL, tilt_deg=5).box((-9, 1.0, -9), (9, 1.1, 9))


def test_an_object_cut_by_the_image_says_so() -> None:
    scene = Scene().plane().box((-0.7, -0.1, 0), (-0.45, 0.1, 0.2)).box((0.0, -0.05, 0), (0.1, 0.05, 0.1))
    frame = Segmenter().segment(scene.detections(scene.box_of(2), scene.box_of(3)), scene.image(NOISE))
    assert frame.objects[0].has(PointFlag.CUT_BY_IMAGE)
    assert not frame.objects[1].has(PointFlag.CUT_BY_IMAGE)


@pytest.mark.parametrize(
    ("bounds", "is_cut"),
    [
        ((8, 6, 632, 474), False),  # of 640 x 480: 1.2 % of it is near the border
        ((7, 6, 632, 474), True),
        ((8, 5, 632, 474), True),
        ((8, 6, 633, 474), True),
        ((8, 6, 632, 475), True),
    ],
)
def test_an_object_within_a_hundredth_of_the_image_s_border_is_cut_by_the_image(bounds: Box, is_cut: bool) -> None:
    scene = Scene()
    nothing = np.zeros((240, 320), bool)
    flags = flags_of(scene, nothing, (0, 0, 320, 240), pixels_within(bounds))
    assert (PointFlag.CUT_BY_IMAGE in flags) == is_cut


@pytest.mark.parametrize(("bounds", "is_cut"), [((1, 1, 8, 6), False), ((0, 1, 8, 6), True), ((1, 1, 9, 6), True)])
def test_of_a_tiny_image_the_outermost_pixels_are_its_border(bounds: Box, is_cut: bool) -> None:
    camera = SMALL.scaled(36)
    assert (camera.width, camera.height) == (9, 7)
    image = DepthImage(depth=np.ones((7, 9), np.float32), rgb=None, intrinsics=camera, stamp_ns=0)
    surface = Scene(camera).ground(image).surface
    flags = whole_flags(image, pixels_within(bounds), surface, np.zeros((7, 9), bool), (0, 0, 9, 7))
    assert (PointFlag.CUT_BY_IMAGE in flags) == is_cut


def test_an_object_cut_by_its_box_says_so_and_keeps_to_the_box() -> None:
    scene = two_boxes()
    x0, y0, x1, y1 = scene.box_of(2, pad=0.0)
    frame = Segmenter().segment(scene.detections((x0, y0, x1, y0 + 0.6 * (y1 - y0))), scene.image(NOISE))
    rows, _ = np.nonzero(scene.pixels(frame.objects[0].xyz))
    assert frame.objects[0].has(PointFlag.CUT_BY_BOX)
    assert rows.max() < y0 + 0.6 * (y1 - y0)


@pytest.mark.parametrize(("outside", "is_cut"), [(7, False), (9, True)])
def test_an_object_of_which_more_than_a_twelfth_lies_outside_its_box_is_cut_by_it(outside: int, is_cut: bool) -> None:
    chosen = chosen_cells((100, 100, 100 + 100 - outside, 101)) | chosen_cells((50, 50, 50 + outside, 51))
    flags = flags_of(Scene(SMALL).plane(), chosen, (90, 90, 210, 110))
    assert flags == (PointFlag.CUT_BY_BOX if is_cut else PointFlag(0))


def test_nothing_is_cut_by_nothing() -> None:
    nothing = pixels_within((2, 2, 0, 0), count=0)
    flags = flags_of(wall(), chosen_cells((0, 0, 0, 0)), (100, 60, 220, 180), nothing)
    assert flags == PointFlag(0)


def test_a_patch_of_wall_is_flagged() -> None:
    scene = Scene(tilt_deg=5).plane(z=-0.6).box((-9, 1.0, -9), (9, 1.1, 9))
    thing = Segmenter().segment(scene.detections((200, 120, 420, 280)), scene.image(NOISE)).objects[0]
    assert thing.has(PointFlag.WALL_LIKE)


def test_a_flat_thing_whose_plane_ends_at_its_box_is_no_wall() -> None:
    window = (100, 60, 220, 180)
    assert PointFlag.WALL_LIKE in flags_of(wall(), chosen_cells(window), window)
    screen = Scene(SMALL, tilt_deg=5).box((-9, 1.5, -9), (9, 1.6, 9)).box((-0.3, 1.0, -0.15), (0.3, 1.02, 0.2))
    x0, y0, x1, y1 = (round(edge) for edge in screen.box_of(2, pad=0.0))
    assert flags_of(screen, screen.owner == 2, (x0, y0, x1, y1)) == PointFlag(0)


def test_a_patch_of_wall_is_recognised_by_its_own_plane_whatever_else_is_seen() -> None:
    scene = wall().plane(z=-0.4)
    share = (scene.owner == 1).mean()
    assert 0.5 < share < 0.8  # the rest is floor
    window = (120, 40, 200, 100)
    assert PointFlag.WALL_LIKE in flags_of(scene, chosen_cells(window), window)


def test_a_thing_on_a_wall_that_is_not_flat_is_no_wall() -> None:
    scene = wall().box((-0.2, 0.85, -0.3), (0.2, 1.0, 0.1))
    window = (100, 60, 220, 180)
    assert 0.15 < (scene.owner == 2)[60:180, 100:220].mean() < 0.25
    assert flags_of(scene, chosen_cells(window), window) == PointFlag(0)


@pytest.mark.parametrize(("cells", "is_wall"), [(MIN_CELLS, False), (MIN_CELLS + 1, True)])
def test_of_few_cells_nothing_is_said_to_be_a_wall(cells: int, is_wall: bool) -> None:
    chosen = chosen_cells((100, 100, 120, 110)).ravel()
    chosen[np.flatnonzero(chosen)[cells:]] = False
    flags = flags_of(wall(), chosen.reshape(240, 320), (100, 100, 120, 110))
    assert (PointFlag.WALL_LIKE in flags) == is_wall


@pytest.mark.parametrize(("width", "is_wall"), [(40, False), (60, True)])
def test_where_next_to_nothing_is_seen_around_a_patch_it_is_not_known_to_be_a_wall(width: int, is_wall: bool) -> None:
    scene = wall()
    surface = scene.ground(scene.image(NOISE)).surface.crop((100, 60, 100 + width, 101))
    chosen = np.ones((41, width), bool)
    chosen[40] = False  # a row is all that is around
    flags = whole_flags(scene.image(), pixels_within(INSIDE), surface, chosen, (0, 0, width, 40))
    assert (PointFlag.WALL_LIKE in flags) == is_wall


def test_a_plane_that_leans_both_ways_is_found_in_a_corner_of_it() -> None:
    x, y = np.linspace(-0.5, 0.5, 64).astype(np.float32), np.linspace(-0.4, 0.4, 48).astype(np.float32)
    depth = (1.0 / (0.3 * x - 0.2 * y[:, None] + 0.5)).astype(np.float32)
    chosen = np.add.outer(np.arange(48), np.arange(64)) < 50
    slope = np.sqrt(0.3**2 + 0.2**2 + 0.5**2)
    assert _KERNELS.fit_plane(depth, x, y, chosen) == pytest.approx((0.3, -0.2, 0.5, slope), abs=1e-4)


@pytest.mark.parametrize(("column", "is_cut"), [(30, True), (43, True), (44, False), (200, False)])
def test_an_object_at_the_border_of_what_a_rectified_picture_shows_is_cut_by_the_image(
    column: int, is_cut: bool
) -> None:
    """The picture begins at column 40 in its upper half, and 4 px, a hundredth of the width, are near to that."""
    shown = np.ones((240, 320), bool)
    shown[:120, :40] = False
    scene = Scene(SMALL)
    image = replace(scene.image(NOISE), shown=shown)
    u, v = np.arange(column, column + 20.0), np.full(20, 60.0)
    xyz = np.column_stack([(u - SMALL.cx) / SMALL.fx, (v - SMALL.cy) / SMALL.fy, np.ones(20)]).astype(np.float32)
    there = Pixels(xyz, xyz, None, np.zeros(20, np.uint16), 1.0, (column, 60, column + 20, 61))
    surface = scene.ground(image).surface
    flags = whole_flags(image, there, surface, np.zeros((240, 320), bool), (0, 0, 320, 240))
    assert (PointFlag.CUT_BY_IMAGE in flags) == is_cut
    below = replace(there, xyz=xyz + np.float32([0, 100 / SMALL.fy, 0]), bounds=(column, 160, column + 20, 161))
    flags = whole_flags(image, below, surface, np.zeros((240, 320), bool), (0, 0, 320, 240))
    assert PointFlag.CUT_BY_IMAGE not in flags
