# SPDX-License-Identifier: Apache-2.0
"""One object out of its box."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.boxes import Box, pixel_boxes
from objreg_ros.segmenter.objects.isolate import Cells, Isolated, cut_out, isolate, taken_cells
from objreg_ros.segmenter.objects.targets import Outline
from objreg_ros.segmenter.params import SegmenterParams
from segmenter.scenes import CAMERA, Scene, two_boxes

NOISE = 0.0015
PARAMS = SegmenterParams()


@pytest.fixture(scope="module")
def boxes() -> Scene:
    return two_boxes()


def isolated(scene: Scene, box: Box, image: DepthImage | None = None) -> Isolated:
    seen = scene.image(NOISE) if image is None else image
    return isolate(seen, box, scene.ground(seen), PARAMS)


def pixel_box(scene: Scene, owner: int) -> Box:
    return pixel_boxes(scene.detections(scene.box_of(owner)), scene.camera.height, scene.camera.width)[0]


@pytest.mark.parametrize("owner", [2, 3])
def test_a_box_on_a_table_is_found_whole_and_nothing_is_wrong_with_it(boxes: Scene, owner: int) -> None:
    found = isolated(boxes, pixel_box(boxes, owner))
    assert boxes.iou(found.pixels.xyz, owner) > 0.95
    assert found.flags == PointFlag(0)


def test_its_cells_are_those_that_its_pixels_are_in(boxes: Scene) -> None:
    found = isolated(boxes, pixel_box(boxes, 2))
    assert found.cells is not None
    assert found.cells.step == 2
    left, top, right, bottom = found.cells.window
    assert found.cells.chosen.shape == (bottom - top, right - left)
    cells = np.zeros((240, 320), bool)
    cells[top:bottom, left:right] = found.cells.chosen
    seen = boxes.pixels(found.pixels.xyz).reshape(240, 2, 320, 2).any(axis=(1, 3))
    assert (cells & seen).sum() > 0.97 * max(cells.sum(), seen.sum())


def test_no_pixel_outside_the_box_is_taken(boxes: Scene) -> None:
    x0, y0, x1, y1 = pixel_box(boxes, 2)
    half = (x0, y0, (x0 + x1) // 2, (y0 + y1) // 2)
    found = isolated(boxes, half)
    rows, columns = np.nonzero(boxes.pixels(found.pixels.xyz))
    assert len(rows) > 500
    assert columns.min() >= half[0] and columns.max() < half[2]
    assert rows.min() >= half[1] and rows.max() < half[3]
    assert PointFlag.CUT_BY_BOX in found.flags


def test_a_thing_without_support_is_still_segmented_and_says_so() -> None:
    scene = Scene(tilt_deg=10).box((-0.15, 0.2, -0.1), (0.15, 0.3, 0.1))
    found = isolated(scene, pixel_box(scene, 1))
    assert scene.iou(found.pixels.xyz, 1) > 0.9
    assert PointFlag.UNSUPPORTED in found.flags


def test_a_box_around_bare_table_shows_no_object(boxes: Scene) -> None:
    found = isolated(boxes, (280, 300, 360, 360))
    assert len(found.pixels) == 0
    assert found.cells is not None
    assert not found.cells.chosen.any()
    assert found.flags == PointFlag(0)


def test_where_nothing_was_measured_there_is_no_object_and_no_support(boxes: Scene) -> None:
    image = replace(boxes.image(), depth=np.zeros((480, 640), np.float32))
    found = isolated(boxes, pixel_box(boxes, 2), image)
    assert len(found.pixels) == 0
    assert found.flags == PointFlag.UNSUPPORTED


@pytest.mark.parametrize(
    "box", [(0, 0, 1, 1), (639, 0, 640, 1), (0, 479, 1, 480), (639, 479, 640, 480), (320, 5, 321, 475)]
)
def test_the_smallest_boxes_are_looked_at_without_harm(boxes: Scene, box: Box) -> None:
    found = isolated(boxes, box)
    assert found.cells is not None
    left, top, right, bottom = found.cells.window
    assert 0 <= left < right <= 320 and 0 <= top < bottom <= 240
    assert len(found.pixels) <= (box[2] - box[0]) * (box[3] - box[1])


@pytest.mark.parametrize(("side", "step"), [(120, 2), (160, 4)])
def test_a_large_box_is_looked_at_on_the_coarse_grid(side: int, step: int) -> None:
    scene = Scene(tilt_deg=50).plane()
    half = side / 2 / CAMERA.fx  # about so large in pixels, a metre away
    scene.box((-half, -0.05, 0), (half, 0.05, 2 * half))
    found = isolated(scene, (320 - side // 2, 240 - side // 2, 320 + side // 2, 240 + side // 2))
    assert found.cells is not None
    assert found.cells.step == step


def test_the_largest_object_is_found_whole_on_the_coarse_grid_too() -> None:
    scene = Scene().plane().box((-0.3, 0.0, 0), (0.3, 0.3, 0.25))
    found = isolated(scene, pixel_box(scene, 2))
    assert found.cells is not None
    assert found.cells.step == 4
    assert scene.iou(found.pixels.xyz, 2) > 0.95


def test_without_colour_the_object_is_the_same_but_for_it(boxes: Scene) -> None:
    plain = isolated(boxes, pixel_box(boxes, 2), replace(boxes.image(NOISE), rgb=None))
    assert plain.pixels.rgb is None
    np.testing.assert_array_equal(plain.pixels.xyz, isolated(boxes, pixel_box(boxes, 2)).pixels.xyz)


@pytest.mark.parametrize("step", [2, 4])
def test_the_cells_of_all_objects_are_taken_on_the_grid_of_the_supports(step: int) -> None:
    scene = Scene()
    ground = scene.ground(scene.image())
    pixels = isolated(two_boxes(), pixel_box(two_boxes(), 2)).pixels
    chosen = np.zeros((6, 8), bool)
    chosen[1:5, 2:4] = True
    cells = [Cells(np.ones((2, 2), bool), (30, 20, 32, 22), 2), Cells(chosen, (14, 8, 22, 14), step), None]
    taken = taken_cells([Isolated(pixels, PointFlag(0), one) for one in cells], ground)
    coarse = np.zeros((120, 160), bool)
    coarse[10, 15] = True
    if step == 4:
        coarse[9:13, 16:18] = True
    else:
        coarse[5:7, 8] = True  # rows 9 to 12 and columns 16 and 17 of the fine grid
    np.testing.assert_array_equal(taken[::2, ::2], coarse)


def masked(scene: Scene, mask: np.ndarray, box: Box) -> Isolated:
    image = scene.image(NOISE)
    return cut_out(image, box, Outline(mask), scene.ground(image), PARAMS)


def test_what_a_mask_covers_is_the_object_whatever_stands_there(boxes: Scene) -> None:
    table = np.zeros(boxes.owner.shape, bool)
    table[300:360, 280:360] = True
    table &= boxes.owner == 1
    found = masked(boxes, table, (280, 300, 360, 360))
    seen = boxes.pixels(found.pixels.xyz)
    assert (seen & table).sum() > 0.95 * table.sum() and (seen & ~table).sum() < 0.05 * table.sum()


def test_a_mask_that_spills_over_an_edge_takes_little_of_what_is_behind(boxes: Scene) -> None:
    own = boxes.owner == 2
    found = masked(boxes, own, pixel_box(boxes, 2))
    assert boxes.iou(found.pixels.xyz, 2) > 0.95
    assert found.cells is not None and PointFlag.CUT_BY_BOX not in found.flags


@pytest.mark.parametrize("size", [(481, 640), (482, 641), (483, 643)])
def test_a_mask_of_a_picture_whose_size_is_no_multiple_of_a_cell_fits_its_grid(size: tuple[int, int]) -> None:
    height, width = size
    scene = Scene(replace(CAMERA, width=width, height=height)).plane().box((-0.3, 0.0, 0), (0.3, 0.3, 0.25))
    mask = np.ones(size, bool)
    assert len(masked(scene, mask, (0, 0, width, height)).pixels) > 0.9 * (scene.owner > 0).sum()
