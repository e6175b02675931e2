# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.bridge.camera.registered_depth import camera_for, moved, register
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import pose, rotation_from_vector

DEPTH = Intrinsics(fx=60.0, fy=60.0, cx=39.5, cy=29.5, width=80, height=60)
NARROW = Intrinsics(fx=100.0, fy=100.0, cx=40.0, cy=30.0, width=80, height=60)


def shifted(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    return pose(np.eye(3), np.array([x, y, z]))


def plane(metres: float, camera: Intrinsics = DEPTH) -> np.ndarray:
    return np.full((camera.height, camera.width), metres, np.float32)


def depth_image(metres: np.ndarray, shown: np.ndarray | None = None) -> DepthImage:
    return DepthImage(depth=metres, rgb=None, intrinsics=DEPTH, stamp_ns=7, frame_id="depth", shown=shown)


def test_one_camera_at_one_place_gives_depth_back_to_the_bit() -> None:
    metres = np.random.default_rng(1).uniform(0.3, 9.0, (60, 80)).astype(np.float32)
    metres[::7, ::5] = 0.0
    np.testing.assert_array_equal(moved(metres, DEPTH, np.eye(4), DEPTH), metres)


@pytest.mark.parametrize("factor", [0.5, 2.0, 2.7])
def test_a_plane_fills_a_finer_and_a_coarser_picture_without_holes(factor: float) -> None:
    width, height = round(80 * factor), round(60 * factor)
    cx, cy = 40 * factor - 0.5, 30 * factor - 0.5
    picture = Intrinsics(fx=60 * factor, fy=60 * factor, cx=cx, cy=cy, width=width, height=height)
    np.testing.assert_array_equal(moved(plane(2.0), DEPTH, np.eye(4), picture), plane(2.0, picture))


def test_a_step_is_moved_by_its_own_parallax_and_what_depth_did_not_see_stays_empty() -> None:
    metres = plane(3.0)
    metres[:, 40:] = 1.0
    found = moved(metres, DEPTH, shifted(-0.1), DEPTH)  # 6 px at 1 m, 2 px at 3 m
    row = found[30]
    assert (row[34:74] == 1.0).all() and (row[:34] == 3.0).all() and (row[74:] == 0.0).all()
    found = moved(metres, DEPTH, shifted(0.1), DEPTH)
    assert (found[30, 2:42] == 3.0).all() and (found[30, 42:46] == 0.0).all() and (found[30, 46:] == 1.0).all()


def test_the_nearest_wins_and_nothing_behind_shines_through_where_the_picture_is_finer() -> None:
    metres = plane(4.0)
    metres[20:40, 30:50] = 1.0
    picture = Intrinsics(fx=150.0, fy=150.0, cx=100.0, cy=75.0, width=200, height=150)
    found = moved(metres, DEPTH, shifted(-0.2, 0.05), picture)
    block = found == 1.0
    rows, columns = np.nonzero(block)
    assert block[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].all()
    assert np.ptp(columns) + 1 == pytest.approx(50, abs=1) and np.ptp(rows) + 1 == pytest.approx(50, abs=1)
    assert columns.mean() == pytest.approx(150 * (np.mean([30, 49]) - 39.5) / 60 - 0.2 * 150 + 100, abs=0.6)


def test_a_slanted_wall_that_the_picture_sees_more_squarely_has_no_holes() -> None:
    columns = (np.arange(80) - DEPTH.cx) / DEPTH.fx
    metres = np.tile((2.0 / (1.0 - 0.9 * columns)).astype(np.float32), (60, 1))  # x goes away with z
    found = moved(metres, DEPTH, shifted(0.4), DEPTH)
    inside = found[20:40, 22:70]
    x = (np.arange(80) - DEPTH.cx) / DEPTH.fx  # the plane z = 2 + 0.9 x, seen from 0.4 m to the left
    expected = (2.0 - 0.9 * 0.4) / (1.0 - 0.9 * x)
    assert (inside > 0).all()
    np.testing.assert_allclose(inside[10], expected[22:70], rtol=0.03)


@pytest.mark.parametrize("degrees", [3.0, 45.0, 90.0, 180.0])
def test_a_sensor_that_is_turned_about_its_axis_leaves_no_holes(degrees: float) -> None:
    T = pose(rotation_from_vector(np.array([0.0, 0.0, np.radians(degrees)])), np.zeros(3))
    found = moved(plane(2.0), DEPTH, T, DEPTH)
    assert (found[10:50, 20:60] == 2.0).all()


def test_a_sensor_that_looks_down_gives_depth_along_the_axis_of_colour() -> None:
    T = pose(rotation_from_vector(np.array([np.radians(10.0), 0.0, 0.0])), np.array([0.02, -0.03, 0.01]))
    rays = np.dstack([*np.meshgrid((np.arange(80) - 39.5) / 60, (np.arange(60) - 29.5) / 60), np.ones((60, 80))])
    metres = (2.0 - T[2, 3]) / (rays @ T[2, :3])  # the plane z = 2 m of colour
    found = moved(metres.astype(np.float32), DEPTH, T, DEPTH)
    np.testing.assert_allclose(found[found > 0], 2.0, atol=1e-5)
    assert (found > 0).mean() > 0.7


def test_what_is_behind_the_camera_or_not_measured_is_nowhere() -> None:
    metres = plane(1.0)
    metres[:, :40] = 0.0
    assert not moved(metres, DEPTH, shifted(0, 0, -1.5), DEPTH).any()
    assert not moved(np.zeros((60, 80), np.float32), DEPTH, np.eye(4), DEPTH).any()


def test_a_fine_picture_is_reduced_to_about_the_angle_of_a_pixel_of_depth() -> None:
    fine = Intrinsics(fx=300.0, fy=300.0, cx=199.5, cy=149.5, width=400, height=300)
    reduced = camera_for(fine, DEPTH)
    assert (reduced.width, reduced.height, reduced.fx, reduced.cx) == pytest.approx((80, 60, 60.0, 39.5))
    assert camera_for(DEPTH, fine) is DEPTH
    assert camera_for(NARROW, DEPTH).fx == pytest.approx(60.0)


def test_colour_is_reduced_with_its_camera_and_the_frame_is_that_of_colour() -> None:
    fine = Intrinsics(fx=300.0, fy=300.0, cx=199.5, cy=149.5, width=400, height=300)
    rgb = np.full((300, 400, 3), (9, 8, 7), np.uint8)
    found = register(depth_image(plane(2.0)), np.eye(4), fine, rgb, "colour")
    assert found.rgb is not None and found.rgb.shape == (60, 80, 3) and (found.rgb == (9, 8, 7)).all()
    assert (found.frame_id, found.stamp_ns, found.shown) == ("colour", 7, None)


def test_where_the_picture_of_depth_ends_is_known() -> None:
    wide = Intrinsics(fx=30.0, fy=30.0, cx=39.5, cy=29.5, width=80, height=60)
    found = register(depth_image(plane(2.0)), np.eye(4), wide)
    assert found.shown is not None and found.shown[16:44, 21:59].all()
    assert not found.shown[:14].any() and not found.shown[:, :19].any()
    left = np.ones((60, 80), np.bool_)
    left[:, :40] = False
    found = register(depth_image(plane(2.0), left), np.eye(4), wide)
    assert found.shown is not None and not found.shown[:, :39].any() and found.shown[30, 42:59].all()


def test_depth_that_lies_beside_the_picture_is_refused_with_where_it_was_taken_to_be() -> None:
    with pytest.raises(ValueError, match=r"got none with depth at 9.000 0.000 0.000 m in 'colour'.*tf_static"):
        register(depth_image(plane(1.0)), shifted(9.0), DEPTH, None, "colour")


def test_depth_in_any_layout_and_read_only_is_taken() -> None:
    metres = np.asfortranarray(plane(2.0))
    metres.flags.writeable = False
    found = register(depth_image(metres), shifted(0.01), NARROW)
    np.testing.assert_array_equal(found.depth, register(depth_image(plane(2.0)), shifted(0.01), NARROW).depth)
