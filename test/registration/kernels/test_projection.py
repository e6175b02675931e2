# SPDX-License-Identifier: Apache-2.0
"""Tests of where a camera sees points, and of what its image holds there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector, transform
from objreg_ros.registration.kernels.projection import LEAST_DEPTH, between, lands, nearest, project, spread

CAMERA = (131.0, 129.0, 79.5, 59.5)
IMAGE = np.arange(20.0).reshape(4, 5)  # rises by 1 along u and by 5 along v


def test_points_land_where_the_pinhole_says() -> None:
    T = pose(rotation_from_vector(np.array([0.1, -0.2, 0.3])), np.array([0.2, -0.1, 0.4]))
    points = np.random.default_rng(1).uniform((-1, -1, 1), (1, 1, 3), (50, 3)).astype(np.float32)
    u, v, z = project(points, T, CAMERA)
    x, y, depth = transform(T, points.astype(float)).T
    fx, fy, cx, cy = CAMERA
    np.testing.assert_allclose(u, fx * x / depth + cx, rtol=1e-9)
    np.testing.assert_allclose(v, fy * y / depth + cy, rtol=1e-9)
    np.testing.assert_allclose(z, depth, rtol=1e-9)


def test_points_behind_and_in_the_camera_land_nowhere() -> None:
    points = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * LEAST_DEPTH]], np.float32)
    u, v, z = project(points, np.eye(4), CAMERA)
    assert not any(lands(u[k], v[k], z[k], np.zeros((120, 160))) for k in range(3))


@pytest.mark.parametrize("place", [(-0.01, 1.0), (1.0, -0.01), (4.0, 1.0), (1.0, 3.0)])
def test_a_place_that_has_not_four_pixels_about_it_is_none_to_land(place: tuple[float, float]) -> None:
    assert not lands(*place, 1.0, IMAGE)
    assert lands(1.0, 1.0, 1.0, IMAGE)


def test_a_place_is_in_the_pixel_whose_middle_is_nearest() -> None:
    assert nearest(2.4, 0.6) == (1, 2)


def test_an_image_is_looked_up_between_its_pixels_and_knows_its_slopes() -> None:
    assert between(IMAGE, 2.25, 1.5) == pytest.approx((2.25 + 5 * 1.5, 1.0, 5.0))


def test_what_is_spread_over_four_pixels_is_all_there_and_about_its_place() -> None:
    image = np.zeros((4, 5, 2), np.float32)
    spread(image, 2.25, 1.5, 8.0)
    assert image.sum(axis=(0, 1)) == pytest.approx((8.0, 1.0))
    assert image[1, 2] == pytest.approx((3.0, 0.375)) and image[2, 3] == pytest.approx((1.0, 0.125))
    assert (image[..., 1] @ np.arange(5)).sum() == pytest.approx(2.25)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("objreg_ros.native.checked") is None, reason="build with OBJREG_CHECKED=1")
def test_no_frame_that_passes_the_checks_of_its_type_has_a_kernel_look_beside_an_array(
    repository: Path,
) -> None:
    checked = {"OBJREG_CHECKED": "1", "PYTHONPATH": str(repository)}
    attack = [sys.executable, str(repository / "test/registration/hostile.py"), "20"]
    done = subprocess.run(attack, env=os.environ | checked, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    frames, refused, tried = map(int, re.findall(r"\d+", done.stdout))
    assert frames >= 40 and refused < frames / 2 and tried >= 20, done.stdout
