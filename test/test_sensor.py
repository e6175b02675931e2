# SPDX-License-Identifier: Apache-2.0
"""How noisy the depth of a view is, measured on planes with known noise."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.sensor import (
    DEPTH_NOISE_GROWTH,
    DEPTH_NOISE_M,
    DEPTH_TOLERANCE_GROWTH,
    DEPTH_TOLERANCE_M,
    KINECT,
    NEAR_M,
    depth_noise,
    depth_sigma,
    depth_tolerance,
    measured_noise,
    silhouette_tolerance,
)


def tilted_plane(noise: float, seed: int = 0) -> Array:
    """Depth (120, 160) m of a floor from 1 to 3 m away, with so many times the noise of the model."""
    rows, columns = np.mgrid[:120, :160]
    depth = 1.0 / (0.35 + 0.005 * rows + 0.0005 * columns)
    sigma = DEPTH_NOISE_M + DEPTH_NOISE_GROWTH * (depth - NEAR_M) ** 2
    return np.asarray(depth + noise * sigma * np.random.default_rng(seed).normal(size=depth.shape))


@pytest.mark.parametrize("noise", [0.5, 1.25, 3.0])
def test_the_noise_of_a_slanted_plane_is_measured_in_that_of_a_kinect(noise: float) -> None:
    assert depth_noise(tilted_plane(noise)) == pytest.approx(noise / KINECT, rel=0.03)


def test_edges_and_holes_change_next_to_nothing() -> None:
    depth = tilted_plane(2.5)
    depth[30:60, 40:80] -= 0.4
    depth[80:100, 20:70] = 0.0
    assert depth_noise(depth) == pytest.approx(2.5 / KINECT, rel=0.06)


def test_a_plane_without_noise_has_none_and_a_view_without_depth_counts_as_usual() -> None:
    assert depth_noise(tilted_plane(0.0)) < 1e-6
    assert depth_noise(np.zeros((120, 160))) == 1.0 and depth_noise(np.ones((2, 3))) == 1.0
    assert measured_noise(np.zeros((120, 160))) is None


def test_depths_of_noisier_cameras_may_differ_by_more_and_never_by_less_than_a_kinect_s() -> None:
    assert depth_tolerance(1.0, 1.0) == depth_tolerance(0.2, 0.3) == (DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_GROWTH)
    base, growth = depth_tolerance(1.0, 7.0)
    assert base == DEPTH_TOLERANCE_M and growth == pytest.approx(5.0 * DEPTH_TOLERANCE_GROWTH)


def test_silhouettes_of_noisier_cameras_may_differ_by_more_with_distance() -> None:
    usual, noisy = silhouette_tolerance(0.4), silhouette_tolerance(2.0)
    assert tuple(usual) == tuple(silhouette_tolerance(1.0))
    assert noisy[0] == usual[0] and noisy[1] == 2.0 * usual[1]


def test_a_depth_s_deviation_grows_with_its_distance_and_with_the_noise_of_its_camera() -> None:
    near, far = depth_sigma(np.array([NEAR_M, NEAR_M + 1.0]))
    assert near == DEPTH_NOISE_M and far == pytest.approx(DEPTH_NOISE_M + DEPTH_NOISE_GROWTH)
    assert np.allclose(depth_sigma(np.array([0.2, 2.0]), 2.0), 2.0 * depth_sigma(np.array([NEAR_M, 2.0])))
