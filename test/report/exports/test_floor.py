# SPDX-License-Identifier: Apache-2.0
"""Which way is up, and where the floor is."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector, transform
from objreg_tools.report.exports.floor import Heights, upright
from report.exports.drawn_flat import looking, see, walk

DOWN = np.array([0.0, 0.0, -1.0])


def test_the_first_camera_of_a_recording_without_odometry_is_turned_upright() -> None:
    first = looking(0.0, 0.0, 90.0, down_deg=20.0)
    gravity = first[:3, :3].T @ DOWN
    T_level_map = upright([(np.eye(4), gravity, 1.0), (np.eye(4), None, 1.0)])
    assert T_level_map is not None
    np.testing.assert_allclose(T_level_map[:3, :3] @ gravity, DOWN, atol=1e-12)
    ahead, right = T_level_map[:3, 2], T_level_map[:3, 0]
    np.testing.assert_allclose(right, (1.0, 0.0, 0.0), atol=1e-12)
    assert ahead[1] == pytest.approx(np.cos(np.radians(20.0)))


def test_a_map_that_is_level_stays_as_it_is() -> None:
    tilted = rotation_from_vector(np.array([np.radians(2.0), 0.0, 0.0])) @ DOWN
    level = upright([(np.eye(4), tilted, 1.0)])
    assert level is not None and np.array_equal(level, np.eye(4))
    tilted = rotation_from_vector(np.array([np.radians(4.0), 0.0, 0.0])) @ DOWN
    turned = upright([(np.eye(4), tilted, 1.0)])
    assert turned is not None and not np.array_equal(turned, np.eye(4))


def test_without_gravity_nothing_says_what_is_up() -> None:
    assert upright([(np.eye(4), None, 1.0)]) is None
    assert upright([(np.eye(4), DOWN, 0.0)]) is None
    assert upright([]) is None


def test_the_floor_is_below_tables() -> None:
    heights = Heights()
    for T in walk():
        heights.add_view(T, see(T, noise=0.003))
    assert heights.floor() == pytest.approx(0.0, abs=0.02)


def test_the_floor_of_a_map_that_begins_at_the_camera_is_below_it() -> None:
    T = looking(1.5, 1.0, 60.0, down_deg=30.0)
    heights = Heights()
    heights.add_view(pose(np.eye(3), np.array([0.0, 0.0, -1.3])) @ T, see(T))
    assert heights.floor() == pytest.approx(-1.3, abs=0.02)


def test_where_no_surface_is_seen_from_above_there_is_no_floor() -> None:
    assert Heights().floor() is None
    T = looking(1.5, 1.0, 90.0, down_deg=-30.0)
    heights = Heights()
    heights.add_view(T, see(T))
    assert heights.floor() is None


def test_the_points_of_the_flat_are_on_its_walls() -> None:
    T = looking(1.5, 1.0, 90.0)
    seen = transform(T, see(T).xyz.astype(float))
    assert np.nanmin(seen[..., 2]) == pytest.approx(0.0, abs=1e-5)
