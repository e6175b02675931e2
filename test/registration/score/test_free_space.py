# SPDX-License-Identifier: Apache-2.0
"""Tests of what one view says of the points of another."""

from __future__ import annotations

import numpy as np

from objreg_ros.geometry import pose
from objreg_ros.registration.prepare.views import prepare_sight
from objreg_ros.registration.score.free_space import INLIERS, OCCLUDED, SEEN, VIOLATIONS, correlation, count
from registration.rooms import keyframe, seen_from


def count_visibility(T: np.ndarray) -> np.ndarray:
    sight = prepare_sight(keyframe(seen_from(0.0)).view, 4.0, 3.0)
    return count(sight.points, sight.shades, T, sight.near, sight.far, sight.detail, sight.camera, 0.02, 0.006)


def test_a_view_agrees_with_itself_in_depth_and_shade() -> None:
    counts = count_visibility(np.eye(4))
    assert counts[INLIERS] == counts[SEEN] > 15000
    assert correlation(counts) > 0.99


def test_points_that_come_nearer_float_in_free_space() -> None:
    counts = count_visibility(pose(np.eye(3), np.array([0.0, 0.0, -0.3])))
    assert counts[VIOLATIONS] > 0.8 * counts[SEEN]


def test_points_that_go_behind_are_hidden() -> None:
    counts = count_visibility(pose(np.eye(3), np.array([0.0, 0.0, 0.3])))
    assert counts[OCCLUDED] > 0.8 * counts[SEEN]


def test_points_behind_the_camera_are_not_seen() -> None:
    assert count_visibility(pose(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)))[SEEN] == 0


def test_shades_that_do_not_vary_correlate_with_nothing() -> None:
    counts = np.zeros(10)
    counts[4] = 100
    assert correlation(counts) == 0.0
