# SPDX-License-Identifier: Apache-2.0
"""The reduced view."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros import limits
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.segmenter.sensor.view import LEAST_WIDTH, reduced_view, step_for


def image(height: int, width: int) -> DepthImage:
    camera = Intrinsics(fx=100.0, fy=100.0, cx=width / 2, cy=height / 2, width=width, height=height)
    depth = np.linspace(1.0, 2.0, height * width, endpoint=False, dtype=np.float32).reshape(height, width)
    rgb = np.full((height, width, 3), 90, np.uint8)
    return DepthImage(depth=depth, rgb=rgb, intrinsics=camera, stamp_ns=0)


def test_points_are_those_of_every_fourth_pixel() -> None:
    full = image(48, 64)
    view = reduced_view(full, 4, 0.2, 4.0)
    np.testing.assert_array_equal(view.xyz[..., 2], full.depth[2::4, 2::4])
    x, _, z = view.xyz[3, 5]
    assert abs(x / z * 100 + 32 - 22) < 1e-4


def test_grey_is_grey_and_odd_sizes_fit() -> None:
    for height, width in ((48, 64), (50, 67), (3, 3), (1, 1)):
        view = reduced_view(image(height, width), 4, 0.2, 4.0)
        assert view.grey is not None
        assert view.grey.shape == view.xyz.shape[:2]
        assert (view.grey == 90).all()


@pytest.mark.parametrize("step", [1, 2, 3, 4])
def test_grey_is_that_of_the_pixel_whose_depth_it_goes_with(step: int) -> None:
    full = image(48, 64)
    v, u = np.mgrid[:48, :64]
    rgb = np.repeat((2 * u + v)[..., None], 3, axis=-1).astype(np.uint8)
    view = reduced_view(DepthImage(depth=full.depth, rgb=rgb, intrinsics=full.intrinsics, stamp_ns=0), step, 0.2, 4.0)
    assert view.grey is not None
    there = rgb[step // 2 :: step, step // 2 :: step, 0].astype(float)
    assert abs(view.grey[:-1, :-1] - there[:-1, :-1]).max() < 0.01  # but for the last, beyond which nothing is


@pytest.mark.parametrize("wavelength", [10.0, 12.0, 16.0, 32.0])
@pytest.mark.parametrize("step", [2, 3, 4])
def test_grey_of_fine_prints_lies_where_its_depth_does(step: int, wavelength: float) -> None:
    full = image(240, 320)
    wave = 2.0 * np.pi / wavelength * np.arange(320)
    rgb = np.broadcast_to(np.rint(128.0 + 90.0 * np.sin(wave))[None, :, None], (240, 320, 3)).astype(np.uint8)
    view = reduced_view(DepthImage(depth=full.depth, rgb=rgb, intrinsics=full.intrinsics, stamp_ns=0), step, 0.2, 4.0)
    assert view.grey is not None
    at, seen = wave[step // 2 :: step], view.grey[20].astype(float) - 128.0
    beside = np.linalg.lstsq(np.stack([np.sin(at), np.cos(at)], axis=1), seen, rcond=None)[0]
    assert abs(np.arctan2(beside[1], beside[0])) * wavelength / (2.0 * np.pi) < 0.05  # px of the picture


def test_depth_out_of_range_is_nan() -> None:
    assert np.isnan(reduced_view(image(48, 64), 4, 0.2, 0.9).xyz).all()


def test_what_is_nearer_than_a_millimetre_is_nan_though_every_depth_is_believed() -> None:
    seen = image(48, 64)
    depth = np.full_like(seen.depth, 1e-4)
    near = reduced_view(DepthImage(depth=depth, rgb=None, intrinsics=seen.intrinsics, stamp_ns=0), 4, 0.0, 4.0)
    assert np.isnan(near.xyz).all()


@pytest.mark.parametrize(("width", "step"), [(1280, 4), (640, 4), (512, 3), (320, 2), (160, 1), (40, 1)])
def test_a_narrow_picture_keeps_more_of_its_pixels(width: int, step: int) -> None:
    camera = Intrinsics(fx=500.0, fy=500.0, cx=0.0, cy=0.0, width=width, height=100)
    assert step_for(camera, 4) == step
    assert width // step_for(camera, 4) >= min(width, LEAST_WIDTH)


@pytest.mark.parametrize(("width", "height", "step"), [(1920, 1080, 4), (3840, 2160, 8), (4096, 3072, 9)])
def test_of_a_huge_picture_fewer_pixels_are_kept(width: int, height: int, step: int) -> None:
    camera = Intrinsics(fx=500.0, fy=500.0, cx=0.0, cy=0.0, width=width, height=height)
    assert step_for(camera, 4) == step
    small = camera.scaled(step)
    assert 0.7 * limits.OWN_VIEW_PIXELS < small.width * small.height <= limits.OWN_VIEW_PIXELS
