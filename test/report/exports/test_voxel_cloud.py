# SPDX-License-Identifier: Apache-2.0
"""Points are thinned to voxels, whatever comes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.report.exports import voxel_cloud
from objreg_tools.report.exports.voxel_cloud import VoxelCloud

HERE = np.eye(4)
QUARTER_LEFT = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([10.0, 0.0, 0.0]))


def test_a_voxel_has_the_mean_of_its_points_and_of_their_colours() -> None:
    cloud = VoxelCloud(0.1)
    cloud.add_points(HERE, np.array([[0.01, 0.0, 0.0], [0.05, 0.0, 0.0]]), np.array([[10, 0, 0], [20, 0, 0]]))
    cloud.add_points(HERE, np.array([[0.09, 0.03, 0.0], [-0.01, 0.0, 0.0]]), np.array([[60, 0, 3], [7, 8, 9]]))
    xyz, rgb = cloud.points()
    np.testing.assert_allclose(xyz, [[-0.01, 0, 0], [0.05, 0.01, 0]], atol=1e-12)
    assert rgb is not None and rgb.tolist() == [[7, 8, 9], [30, 0, 1]]


def test_points_are_moved_into_the_map() -> None:
    cloud = VoxelCloud(0.1)
    cloud.add_points(QUARTER_LEFT, np.array([[[1.05, 0.05, 0.05]]]))
    np.testing.assert_allclose(cloud.points()[0], [[9.95, 1.05, 0.05]])


def test_points_that_were_not_measured_are_left_out() -> None:
    cloud = VoxelCloud(0.1)
    cloud.add_points(HERE, np.array([[np.nan, 0, 0], [0, np.inf, 0], [1, 1, 1]]), np.full((3, 3), 9))
    np.testing.assert_allclose(cloud.points()[0], [[1, 1, 1]])


def test_a_sure_colour_prevails_and_one_that_nobody_knows_is_grey() -> None:
    cloud = VoxelCloud(0.1)
    cloud.add_points(HERE, np.zeros((3, 3)), np.full((3, 3), 100))
    cloud.add_points(HERE, np.zeros((1, 3)), np.array([[250, 0, 0]]), sureness=1e6)
    cloud.add_points(HERE, np.ones((1, 3)))
    assert cloud.points()[1].tolist() == [[250, 0, 0], [128, 128, 128]]


def test_without_any_colour_there_is_none() -> None:
    cloud = VoxelCloud(0.1)
    assert cloud.points()[0].shape == (0, 3) and cloud.points()[1] is None
    cloud.add_points(HERE, np.zeros((3, 3)))
    assert cloud.points()[1] is None


def test_far_from_the_origin_a_point_keeps_its_place() -> None:
    cloud, far = VoxelCloud(0.02), pose(np.eye(3), np.array([450_000.0, 5_400_000.0, 0.0]))
    xyz = np.float32([[0.011, 0.011, 0.011], [1.011, 0.011, 0.011]])
    for _ in range(50):
        cloud.add_points(far, xyz)
    np.testing.assert_allclose(cloud.points()[0] - far[:3, 3], xyz, atol=1e-8)


def test_voxels_double_until_there_are_few_enough() -> None:
    x = np.arange(0.05, 10.0, 0.1)
    cloud = VoxelCloud(0.1, most=30)
    cloud.add_points(HERE, np.stack([x, 0 * x, 0 * x], axis=1))
    assert len(cloud.points()[0]) == 25 and cloud.voxel == 0.4


def test_the_order_in_which_points_come_matters_not(monkeypatch: pytest.MonkeyPatch) -> None:
    xyz = np.random.default_rng(1).normal(size=(500, 3))
    at_once, by_parts = VoxelCloud(0.5), VoxelCloud(0.5)
    at_once.add_points(HERE, xyz)
    monkeypatch.setattr(voxel_cloud, "BATCH", 40)
    by_parts.add_points(HERE, xyz[::-1])
    np.testing.assert_allclose(by_parts.points()[0], at_once.points()[0], atol=1e-12)
    assert len(at_once.points()[0]) < 500


def test_memory_is_bounded_however_much_comes() -> None:
    draws = np.random.default_rng(2)
    cloud = VoxelCloud(0.02)
    tracemalloc.start()
    for _ in range(6):
        cloud.add_points(HERE, draws.uniform(-50, 50, (400_000, 3)).astype(np.float32))
    count, peak = len(cloud.points()[0]), tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count <= voxel_cloud.MOST_POINTS and cloud.voxel > 0.02
    assert peak < 400e6


@pytest.mark.parametrize("voxel", [0.0, -1.0, 0.0009, 10.1, float("nan"), float("inf")])
def test_a_voxel_that_is_none_is_refused(voxel: float) -> None:
    with pytest.raises(ValueError, match=r"expected voxels of 0\.001 to 10 m, got"):
        VoxelCloud(voxel)
