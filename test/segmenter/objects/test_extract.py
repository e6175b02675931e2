# SPDX-License-Identifier: Apache-2.0
"""From chosen cells back to pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import back_project
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.objects.extract import EDGE, Pixels, cell_points, colours, extract
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.surface.cells import Surface, reduce
from segmenter.scenes import Scene, two_boxes

JUMP = (0.012, 0.008)
NOISE = 0.0015
CAMERA = Intrinsics(fx=100.0, fy=110.0, cx=19.5, cy=14.5, width=40, height=30)
WHOLE = (0, 0, 40, 30)


def image_of(depth: np.ndarray) -> DepthImage:
    """A coloured image, every pixel of its own colour, of depth (30, 40)."""
    v, u = np.mgrid[:30, :40]
    rgb = np.stack([u, v, u + v], axis=-1).astype(np.uint8)
    return DepthImage(depth=depth.astype(np.float32), rgb=rgb, intrinsics=CAMERA, stamp_ns=0)


def cells_of(image: DepthImage, step: int = 2) -> Surface:
    return reduce(image.depth, CAMERA, step, (0.2, 9.0, 99.0), JUMP)


def wall() -> DepthImage:
    """All of it a metre away."""
    return image_of(np.ones((30, 40)))


def two_walls() -> DepthImage:
    """One a metre away to the left, the other 2 m to the right; the border is in the middle of a cell of two pixels."""
    return image_of(np.where(np.arange(40) < 21, 1.0, 2.0) * np.ones((30, 1)))


def where(pixels: Pixels) -> np.ndarray:
    """(30, 40) bool: the pixels."""
    found = np.zeros((30, 40), bool)
    uv = np.rint(pixels.xyz[:, :2] / pixels.xyz[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)).astype(int)
    found[uv[:, 1], uv[:, 0]] = True
    assert found.sum() == len(pixels)
    return found


def windowed(shape: tuple[int, int], left: int, top: int, right: int, bottom: int) -> np.ndarray:
    chosen = np.zeros(shape, bool)
    chosen[top:bottom, left:right] = True
    return chosen


def test_the_pixels_of_chosen_cells_come_with_their_points_colours_and_normals() -> None:
    image = image_of(np.linspace(1.0, 1.1, 40) * np.ones((30, 1)))
    surface = cells_of(image)
    pixels = extract(image, WHOLE, surface, windowed((15, 20), 5, 4, 9, 10), JUMP)
    part = (slice(8, 20), slice(10, 18))
    xyz = back_project(image.depth, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)[part].reshape(-1, 3)
    np.testing.assert_allclose(pixels.xyz, xyz, rtol=1e-6)
    assert image.rgb is not None
    np.testing.assert_array_equal(pixels.rgb, image.rgb[part].reshape(-1, 3))
    normals = surface.normals[:, 4:10, 5:9].repeat(2, axis=1).repeat(2, axis=2)
    np.testing.assert_array_equal(pixels.normals, normals.reshape(3, -1).T)
    assert (pixels.normals[:, 2] < -0.9).all()
    assert pixels.bounds == (10, 8, 18, 20)
    assert len(pixels) == 96
    assert (pixels.xyz.dtype, pixels.normals.dtype, pixels.edge.dtype) == (np.float32, np.float32, np.uint16)


def test_a_crop_of_the_surface_gives_the_same() -> None:
    image = two_walls()
    surface, chosen = cells_of(image), windowed((15, 20), 5, 4, 12, 10)
    whole = extract(image, (8, 6, 30, 24), surface, chosen, JUMP)
    crop = extract(image, (8, 6, 30, 24), surface.crop((3, 2, 17, 13)), chosen[2:13, 3:17].copy(), JUMP)
    assert len(whole) > 50
    for name in ("xyz", "normals", "rgb", "edge"):
        np.testing.assert_array_equal(getattr(crop, name), getattr(whole, name))
    assert (crop.area, crop.bounds) == (whole.area, whole.bounds)


def test_no_pixel_outside_the_box_is_taken() -> None:
    box = (11, 7, 24, 19)
    pixels = extract(wall(), box, cells_of(wall()), np.ones((15, 20), bool), JUMP)
    np.testing.assert_array_equal(where(pixels), windowed((30, 40), *box))
    assert pixels.bounds == box


def test_pixels_that_no_cell_covers_belong_to_the_nearest_one() -> None:
    image = wall()
    surface = cells_of(image, step=7)
    assert surface.depth.shape == (4, 5)  # 28 of 30 rows and 35 of 40 columns
    pixels = extract(image, WHOLE, surface, np.ones((4, 5), bool), JUMP)
    assert where(pixels).all()


def test_without_chosen_cells_there_are_no_pixels() -> None:
    pixels = extract(wall(), WHOLE, cells_of(wall()), np.zeros((15, 20), bool), JUMP)
    assert len(pixels) == 0
    assert pixels.area == 0
    assert pixels.rgb is not None
    assert pixels.xyz.shape == pixels.normals.shape == pixels.rgb.shape == (0, 3)


def test_without_colour_there_is_none() -> None:
    image = replace(wall(), rgb=None)
    pixels = extract(image, WHOLE, cells_of(image), np.ones((15, 20), bool), JUMP)
    assert pixels.rgb is None
    assert len(pixels) == 1200
    assert len(colours(image)) == 0
    np.testing.assert_array_equal(colours(wall()), wall().rgb)


@pytest.mark.parametrize("near", [True, False])
def test_a_pixel_beyond_a_depth_jump_belongs_to_the_cell_beside_it_that_is_as_far(near: bool) -> None:
    surface = cells_of(two_walls())
    assert surface.depth[0, 10] == 1.0  # pixel 20 is of the near wall, pixel 21 of the far one
    pixels = extract(two_walls(), WHOLE, surface, (surface.depth < 1.5) == near, JUMP)
    np.testing.assert_array_equal(where(pixels), (two_walls().depth < 1.5) == near)


def test_pixels_without_depth_or_between_two_surfaces_are_left_out() -> None:
    depth = np.ones((30, 40))
    depth[5:8, 11:14], depth[20, 30] = 0.0, 1.4
    pixels = extract(image_of(depth), WHOLE, cells_of(image_of(depth)), np.ones((15, 20), bool), JUMP)
    np.testing.assert_array_equal(where(pixels), depth == 1.0)


@pytest.mark.parametrize(
    ("shape", "kept"),
    [("#", 0), ("##", 0), ("###", 1), ("##/#.", 3), ("#./.#", 0), ("#.#/.#.", 1), ("##/##", 4)],
)
def test_a_pixel_with_less_than_two_neighbours_is_an_outlier(shape: str, kept: int) -> None:
    chosen = np.zeros((30, 40), bool)
    for i, row in enumerate(shape.split("/")):
        for j, mark in enumerate(row):
            chosen[10 + i, 10 + j] = mark == "#"
    depth = np.where(chosen, 1.0, 2.0)
    assert len(extract(image_of(depth), WHOLE, cells_of(image_of(depth), 1), chosen, JUMP)) == kept


def test_points_at_a_silhouette_carry_the_edge_flag() -> None:
    scene = two_boxes()
    thing = Segmenter().segment(scene.detections(scene.box_of(2)), scene.image(NOISE)).objects[0]
    edge = (thing.flags & PointFlag.EDGE) > 0
    assert 0.01 < edge.mean() < 0.3


def test_a_pixel_two_from_a_depth_jump_or_a_hole_is_at_an_edge_and_one_at_the_image_s_border_is_not() -> None:
    image = two_walls()
    depth = np.array(image.depth)
    depth[20, 8] = 0
    image = image_of(depth)
    pixels = extract(image, WHOLE, cells_of(image), np.ones((15, 20), bool), JUMP)
    expected = np.zeros((30, 40), bool)
    expected[:, 19:23] = True
    expected[[18, 22, 20, 20], [8, 8, 6, 10]] = True
    assert set(np.unique(pixels.edge)) == {0, EDGE}
    np.testing.assert_array_equal(pixels.edge == EDGE, expected[where(pixels)])


@pytest.mark.parametrize(("box", "columns"), [((21, 0, 40, 30), (21, 22)), ((0, 0, 21, 30), (19, 20))])
def test_what_lies_outside_the_box_makes_an_edge_too(box: Box, columns: tuple[int, int]) -> None:
    pixels = extract(two_walls(), box, cells_of(two_walls()), np.ones((15, 20), bool), JUMP)
    _, u = np.nonzero(where(pixels))
    assert sorted(set(u[pixels.edge == EDGE].tolist())) == list(columns)


def test_the_area_of_a_wall_is_what_its_pixels_cover() -> None:
    image = image_of(np.full((30, 40), 1.5))
    surface, chosen = cells_of(image), windowed((15, 20), 4, 4, 16, 11)
    pixels = extract(image, WHOLE, surface, chosen, JUMP)
    np.testing.assert_allclose(surface.normals[2, 4:11, 4:16], -1, rtol=1e-6)
    assert pixels.area == pytest.approx(24 * 14 * (1.5 / 100.0) * (1.5 / 110.0), rel=1e-5)


@pytest.mark.parametrize("tilt", [20.0, 45.0, 80.0])
def test_the_area_of_a_table_is_its_own_however_it_is_seen(tilt: float) -> None:
    scene = Scene(tilt_deg=tilt).plane()
    image = scene.image()
    surface = scene.ground(image).surface
    ends = scene.eye + scene.rays * scene.depth[..., None]
    x0, y0, x1, y1 = 240, 180, 400, 300
    chosen = windowed((240, 320), x0 // 2, y0 // 2, x1 // 2, y1 // 2)
    corners = ends[[y0, y0, y1, y1], [x0, x1, x1, x0], :2]  # of the pixels' middles: a pixel wider, half a pixel off
    x, y = corners.T
    shoelace = 0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1))
    assert extract(image, (x0, y0, x1, y1), surface, chosen, JUMP).area == pytest.approx(shoelace, rel=0.03)


@pytest.mark.parametrize(("facing", "cosine"), [(0.0, 0.7), (0.05, 0.1), (0.5, 0.5)])
def test_no_surface_is_taken_to_be_seen_flatter_than_a_tenth_and_one_without_normals_at_45_degrees(
    facing: float, cosine: float
) -> None:
    normals = np.zeros((3, 15, 20), np.float32)
    normals[2] = -facing
    pixels = extract(wall(), WHOLE, replace(cells_of(wall()), normals=normals), np.ones((15, 20), bool), JUMP)
    assert pixels.area == pytest.approx(1200 / (100.0 * 110.0) / cosine, rel=1e-4)
    np.testing.assert_allclose(pixels.normals, np.tile([0, 0, -facing], (1200, 1)), rtol=1e-6)


def test_cells_of_a_whole_frame_come_with_their_points_normals_and_colours() -> None:
    image = two_walls()
    surface, cells = cells_of(image), np.zeros((15, 20), bool)
    cells[[3, 3, 9], [2, 14, 5]] = True
    xyz, normals, rgb = cell_points(surface, cells, colours(image))
    np.testing.assert_allclose(xyz, surface.points[cells])
    np.testing.assert_array_equal(normals, surface.normals[:, cells].T)
    assert rgb.tolist() == [[4, 6, 10], [28, 6, 34], [10, 18, 28]]  # of the first pixel of each cell
    assert [len(part) for part in cell_points(surface, cells, colours(replace(image, rgb=None)))] == [3, 3, 0]
    assert [len(part) for part in cell_points(surface, ~cells & cells, colours(image))] == [0, 0, 0]


def test_boxes_at_every_border_are_whole() -> None:
    image, chosen = wall(), np.ones((15, 20), bool)
    boxes: list[Box] = [(0, 0, 3, 3), (37, 0, 40, 3), (0, 27, 3, 30), (37, 27, 40, 30), (0, 0, 40, 2), (0, 0, 2, 30)]
    for box in boxes:
        assert extract(image, box, cells_of(image), chosen, JUMP).bounds == box
