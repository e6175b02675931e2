# SPDX-License-Identifier: Apache-2.0
"""Clouds of every kind become the same depth image."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics, PointCloud
from objreg_ros.geometry import back_project
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.organise import fit_intrinsics, organise
from segmenter.scenes import CAMERA as CAMERA_VGA
from segmenter.scenes import Scene

CAMERA = Intrinsics(fx=300.0, fy=310.0, cx=30.2, cy=22.9, width=64, height=48)


def hilly_depth() -> np.ndarray:
    v, u = np.mgrid[:48, :64]
    return (1.0 + 0.2 * np.sin(u / 9) + 0.1 * np.cos(v / 7)).astype(np.float32)


def cloud_of(depth: np.ndarray, rgb: np.ndarray | None = None) -> PointCloud:
    xyz = back_project(depth, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    return PointCloud(xyz=xyz, rgb=rgb, stamp_ns=5, frame_id="eye")


def test_an_organised_cloud_gives_its_z_and_its_own_camera() -> None:
    depth = hilly_depth()
    image = organise(cloud_of(depth), None)
    np.testing.assert_array_equal(image.depth, depth)
    got = image.intrinsics
    assert (got.fx, got.fy, got.cx, got.cy) == pytest.approx((300.0, 310.0, 30.2, 22.9), abs=1e-2)
    assert (image.stamp_ns, image.frame_id) == (5, "eye")


def test_given_intrinsics_of_the_same_size_are_kept() -> None:
    assert organise(cloud_of(hilly_depth()), CAMERA).intrinsics == CAMERA


def test_nan_zero_infinity_and_65535_are_all_no_depth() -> None:
    xyz = np.array(cloud_of(hilly_depth()).xyz)
    for column, value in enumerate((np.nan, np.inf, 0.0, 65.535, 65535.0)):
        xyz[:, column, 2] = value
    depth = organise(PointCloud(xyz=xyz, rgb=None, stamp_ns=0), CAMERA).depth
    assert (depth[:, :5] == 0).all()
    assert (depth[:, 5:] > 0).all()


def test_an_unorganised_cloud_gives_the_depth_and_colour_of_the_organised_one() -> None:
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 255, (48, 64, 3)).astype(np.uint8)
    organised = cloud_of(hilly_depth(), rgb)
    order = rng.permutation(48 * 64)
    shuffled = PointCloud(
        xyz=organised.xyz.reshape(1, -1, 3)[:, order], rgb=rgb.reshape(1, -1, 3)[:, order], stamp_ns=5, frame_id="eye"
    )
    image = organise(shuffled, CAMERA)
    np.testing.assert_allclose(image.depth, organise(organised, CAMERA).depth)
    np.testing.assert_array_equal(image.rgb, rgb)


def test_the_nearest_of_two_points_in_a_pixel_wins() -> None:
    xyz = np.array([[[0, 0, 2], [0, 0, 1], [0, 0, 3]]], np.float32)
    rgb = np.array([[[2, 2, 2], [1, 1, 1], [3, 3, 3]]], np.uint8)
    image = organise(PointCloud(xyz=xyz, rgb=rgb, stamp_ns=0), CAMERA)
    assert image.depth[23, 30] == 1
    assert image.rgb is not None
    assert image.rgb[23, 30].tolist() == [1, 1, 1]


def test_points_beside_the_image_are_left_out_on_every_side() -> None:
    depth = hilly_depth()
    inside = cloud_of(depth).xyz.reshape(1, -1, 3)
    beside = np.array([[[-0.4, 0, 1], [0.4, 0, 1], [0, -0.4, 1], [0, 0.4, 1], [0.4, 0.4, 1]]], np.float32)
    both = PointCloud(xyz=np.concatenate([inside, beside], axis=1), rgb=None, stamp_ns=0)
    np.testing.assert_allclose(organise(both, CAMERA).depth, depth, rtol=1e-6)


def test_a_cloud_most_of_which_a_camera_does_not_see_is_refused_and_one_that_sees_wider_is_not() -> None:
    depth = hilly_depth()
    inside = cloud_of(depth).xyz.reshape(1, -1, 3)
    beside = inside + np.array([1.0, 0.0, 0.0], np.float32)
    wider, elsewhere = (np.concatenate([inside, *[beside] * n], axis=1) for n in (1, 2))
    np.testing.assert_allclose(organise(PointCloud(xyz=wider, rgb=None, stamp_ns=0), CAMERA).depth, depth, rtol=1e-6)
    with pytest.raises(ValueError, match=r"expected points within the 64x48 image, got 3072 of 9216 there"):
        organise(PointCloud(xyz=elsewhere, rgb=None, stamp_ns=0), CAMERA)


def test_a_thinned_cloud_gives_the_smaller_image_that_its_points_fill() -> None:
    scene = Scene().plane().box((-0.1, -0.1, 0), (0.1, 0.1, 0.15))
    image = scene.image(0.001)
    xyz = back_project(image.depth, CAMERA_VGA.fx, CAMERA_VGA.fy, CAMERA_VGA.cx, CAMERA_VGA.cy)[image.depth > 0]
    thin = xyz[np.random.default_rng(0).random(len(xyz)) < 0.1]
    small = organise(PointCloud(xyz=thin[None], rgb=None, stamp_ns=0), CAMERA_VGA)
    assert small.depth.shape == (small.intrinsics.height, small.intrinsics.width) == (120, 160)
    thing = Segmenter().segment(scene.detections(scene.box_of(2)), small).objects[0]
    low, high = (thing.xyz @ scene.R.T + scene.eye)[:, :2].min(axis=0), (thing.xyz @ scene.R.T + scene.eye).max(axis=0)
    np.testing.assert_allclose((*low, *high), (-0.1, -0.1, 0.1, 0.1, 0.15), atol=0.02)
    whole = organise(PointCloud(xyz=xyz[None], rgb=None, stamp_ns=0), CAMERA_VGA)
    assert whole.depth.shape == image.depth.shape


@pytest.mark.parametrize(("step", "first"), [(2, 0), (2, 1), (3, 0), (4, 0), (4, 3)])
def test_a_cloud_thinned_from_any_pixel_on_keeps_its_points_on_their_rays(step: int, first: int) -> None:
    v, u = (grid[first::step, first::step].ravel() for grid in np.mgrid[:480, :640])
    x, y = (u - CAMERA_VGA.cx) / CAMERA_VGA.fx, (v - CAMERA_VGA.cy) / CAMERA_VGA.fy
    z = 1.0 / (1.0 - 0.3 * x)  # on the plane z = 1 + 0.3 x
    xyz = np.stack([x * z, y * z, z], axis=-1).astype(np.float32)
    image = organise(PointCloud(xyz=xyz[None], rgb=None, stamp_ns=0), CAMERA_VGA)
    assert (image.depth > 0).sum() == len(u)
    camera = image.intrinsics
    seen = back_project(image.depth, camera.fx, camera.fy, camera.cx, camera.cy)[image.depth > 0]
    np.testing.assert_allclose(seen[:, 2], 1.0 + 0.3 * seen[:, 0], atol=1e-5)


@pytest.mark.parametrize(
    ("xyz", "camera", "said"),
    [
        (np.full((48, 64, 3), np.nan, np.float32), CAMERA, "expected measured points, got 3072"),
        (-np.array(back_project(hilly_depth(), 300, 310, 30, 23)), CAMERA, "negative z"),
        (np.ones((1, 9, 3), np.float32), None, "expected a camera to project it with, got none; publish camera_info"),
        (np.ones((48, 64, 3), np.float32), None, "expected pixels that fit a pinhole camera"),
        (np.array([[[9, 9, 1], [9, 8, 1]]], np.float32), CAMERA, "expected points within the 64x48 image"),
        (np.ones((2, 2, 3), np.float32), None, "expected at least 30 measured points"),
    ],
)
def test_a_cloud_that_cannot_be_used_is_refused_with_expected_and_got(
    xyz: np.ndarray, camera: Intrinsics | None, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        organise(PointCloud(xyz=xyz, rgb=None, stamp_ns=0), camera)


@pytest.mark.parametrize("above", [0.0, 0.35])
def test_a_cloud_with_x_forward_is_refused_beside_a_camera_of_its_size(above: float) -> None:
    optical = back_project(hilly_depth(), CAMERA.fx, CAMERA.fy, CAMERA.cx, 0.0 if above == 0.0 else CAMERA.cy)
    forward = np.stack([optical[..., 2], -optical[..., 0], above + np.abs(optical[..., 1]) + 0.01], axis=-1)
    with pytest.raises(ValueError, match=r"expected an organised cloud in the optical frame .* px beside their pixels"):
        organise(PointCloud(xyz=forward.astype(np.float32), rgb=None, stamp_ns=0), CAMERA)


def test_a_camera_that_does_not_see_the_points_in_their_pixels_gives_way_to_the_clouds_own() -> None:
    other = Intrinsics(fx=250.0, fy=250.0, cx=32.0, cy=24.0, width=64, height=48)
    got = organise(cloud_of(hilly_depth()), other).intrinsics
    assert (got.fx, got.fy, got.cx, got.cy) == pytest.approx((300.0, 310.0, 30.2, 22.9), abs=1e-2)


def test_a_cloud_of_too_few_points_to_measure_keeps_its_camera() -> None:
    xyz = np.full((48, 64, 3), np.nan, np.float32)
    xyz[:2, :8] = (0.0, 0.0, 1.0)
    assert organise(PointCloud(xyz=xyz, rgb=None, stamp_ns=0), CAMERA).intrinsics == CAMERA


def test_intrinsics_fit_in_spite_of_noise_and_holes() -> None:
    rng = np.random.default_rng(1)
    xyz = np.array(cloud_of(hilly_depth()).xyz)
    xyz[..., 2] += rng.normal(0, 0.002, xyz.shape[:2])
    valid = rng.random(xyz.shape[:2]) < 0.3
    got = fit_intrinsics(xyz, valid)
    assert (got.fx, got.cy) == pytest.approx((300.0, 22.9), rel=0.01)


@pytest.mark.parametrize("camera", [None, CAMERA])
@pytest.mark.parametrize("lower", [0.0, 0.4])
@pytest.mark.parametrize("organised", [True, False])
def test_a_cloud_with_x_forward_is_refused_with_what_to_publish(
    camera: Intrinsics | None, lower: float, organised: bool
) -> None:
    optical = np.array(cloud_of(hilly_depth()).xyz) - np.array([0.0, lower, 0.0], np.float32)
    body = optical @ np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]], np.float32).T
    body = body if organised else body.reshape(1, -1, 3)
    with pytest.raises(ValueError, match=r"publish /tf_static between its frame|publish camera_info"):
        organise(PointCloud(xyz=body, rgb=None, stamp_ns=0, frame_id="body"), camera)
