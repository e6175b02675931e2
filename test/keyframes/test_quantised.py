# SPDX-License-Identifier: Apache-2.0
"""What comes back from whole numbers is within a half step, which is well below the noise."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros import limits
from objreg_ros.keyframes import quantised
from objreg_ros.sensor import depth_sigma


def test_depth_errs_by_less_than_a_quarter_of_its_noise_at_any_distance() -> None:
    depth = np.geomspace(0.3, 30.0, 1000).astype(np.float32)
    error = quantised.depth_of(quantised.depth_steps(depth)) - depth
    assert (np.abs(error) < 0.25 * depth_sigma(depth)).all()
    assert (np.abs(error) <= 0.501 * quantised.DEPTH_STEP * depth).all()


def test_depth_comes_back_within_its_range_whatever_the_number() -> None:
    ends = quantised.depth_of(np.array([-(2**40), 2**40]))
    assert ends.tolist() == pytest.approx([limits.LEAST_RANGE, limits.MOST_RANGE])


def test_grey_errs_by_one_level_at_most() -> None:
    grey = np.arange(256, dtype=np.uint8)
    back = quantised.grey_of(quantised.grey_steps(grey))
    assert np.abs(back.astype(int) - grey).max() == 1 and back[0] == 0 and back[-1] == 255


@pytest.mark.parametrize("distance", [0.4, 1.0, 1.5, 4.0])
def test_points_err_by_a_quarter_of_the_noise_at_most(distance: float) -> None:
    xyz = np.random.default_rng(1).uniform(-0.2, 0.2, (500, 3)).astype(np.float32)
    xyz[:, 2] += distance + 0.2
    step = quantised.step_um(xyz)
    error = np.abs(quantised.points_of(quantised.point_steps(xyz, step), step) - xyz).max()
    assert error <= 0.501e-6 * step <= 0.26 * depth_sigma(np.array(distance + 0.1))


@pytest.mark.parametrize("step", [500, 1234, 1999])
def test_points_at_the_end_of_the_range_come_back_within_it(step: int) -> None:
    far = np.full((1, 3), limits.MOST_RANGE, np.float32)
    assert quantised.points_of(quantised.point_steps(far, step), step).max() <= limits.MOST_RANGE


def test_points_beyond_the_range_are_refused() -> None:
    with pytest.raises(ValueError, match="expected points within 1000 m, got one at 1001 m"):
        quantised.points_of(np.array([[0, 1_001_000, 0]]), 1000)


def test_normals_of_all_directions_err_by_four_degrees_at_most_and_unknown_ones_stay_unknown() -> None:
    normals = np.random.default_rng(2).normal(size=(5000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes = np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    back = quantised.normals_of(quantised.normal_steps(np.concatenate([axes, normals]).astype(np.float32)))
    assert np.allclose(back[:7], axes, atol=1e-6)
    turned = np.degrees(np.arccos(np.clip((back[7:] * normals).sum(axis=1), -1.0, 1.0)))
    assert turned.max() < 4.0 and turned.mean() < 1.5


def test_colours_err_by_a_few_levels() -> None:
    rgb = np.random.default_rng(3).integers(0, 256, (5000, 3), np.uint8)
    error = np.abs(quantised.rgb_of(quantised.colour_steps(rgb)).astype(int) - rgb)
    assert error.max() <= 7 and error.mean() < 2.5
