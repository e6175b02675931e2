# SPDX-License-Identifier: Apache-2.0
"""The depth image in cells, with normals."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.surface.cells import cell_size, reduce
from segmenter.scenes import Scene

JUMP = (0.012, 0.008)
LIMITS = (0.2, 4.0, 100.0)


def test_cells_are_of_two_pixels_at_vga_and_of_one_at_a_quarter() -> None:
    assert [cell_size(480, 640), cell_size(240, 320), cell_size(960, 1280), cell_size(3, 3)] == [2, 1, 4, 1]


def test_the_normals_of_a_table_point_up() -> None:
    scene = Scene().plane()
    surface = reduce(scene.image().depth, scene.camera, 2, LIMITS, JUMP)
    cosine = np.tensordot(scene.up, surface.normals, axes=1)[surface.normals[2] != 0]
    assert cosine.size > 50_000
    assert cosine.min() > 0.999


def test_normals_stay_sharp_at_the_edge_of_a_box() -> None:
    scene = Scene().plane().box((-0.2, 0, 0), (0.2, 0.2, 0.2))
    surface = reduce(scene.image().depth, scene.camera, 2, LIMITS, JUMP)
    cosine = np.tensordot(scene.up, surface.normals, axes=1)
    known, top = surface.normals[2] != 0, np.abs(cosine) > 0.98
    assert (top | (np.abs(cosine) < 0.2))[known].mean() > 0.97


def test_depth_out_of_the_limits_is_no_depth() -> None:
    depth = np.full((48, 64), 5.0, np.float32)
    depth[:24] = np.nan
    scene = Scene()
    assert (reduce(depth, scene.camera, 2, LIMITS, JUMP).depth == 0).all()


def test_a_cell_lies_on_the_front_surface_and_not_between_two() -> None:
    depth = np.full((40, 40), 2.0, np.float32)
    depth[:, :21] = 1.0
    cells = reduce(depth, Scene().camera, 2, LIMITS, JUMP).depth
    assert set(np.unique(cells)) == {1.0, 2.0}


def test_a_crop_keeps_points_where_they_are() -> None:
    scene = Scene().plane()
    surface = reduce(scene.image().depth, scene.camera, 2, LIMITS, JUMP)
    crop = surface.crop((30, 20, 90, 70))
    np.testing.assert_array_equal(crop.points, surface.points[20:70, 30:90])
    assert (crop.left, crop.top) == (60, 40)
