# SPDX-License-Identifier: Apache-2.0
"""How a table is looked at, and how one goes on from it."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.trajectory import Waypoint
from objreg_tools.simulation.visits import CameraLook, between


def test_a_look_goes_about_the_table_from_its_start_to_its_stop() -> None:
    centre = np.array([2.0, 1.0, 0.8])
    points = CameraLook(start=0.0, stop=90.0, radius=1.2, height=0.5).waypoints(centre)
    np.testing.assert_allclose(points[0].eye, [3.2, 1.0, 1.3])
    np.testing.assert_allclose(points[-1].eye, [2.0, 2.2, 1.3], atol=1e-9)
    assert all(np.array_equal(point.target, centre) for point in points)


def test_a_look_at_random_sweeps_as_far_as_it_is_given() -> None:
    look = CameraLook.at_random(np.random.default_rng(0), 10.0, -40.0)
    assert (look.start, look.stop) == (10.0, -30.0) and 1.0 < look.radius < 1.35


def test_between_two_places_the_camera_goes_aside_and_pans_evenly() -> None:
    before = Waypoint(np.array([0.0, 0.0, 1.3]), np.array([1.0, 0.0, 0.8]))
    after = Waypoint(np.array([4.0, 0.0, 1.3]), np.array([4.0, 1.0, 0.8]))
    way = between(before, after, detour=1.4)
    ahead = np.array([point.target - point.eye for point in way])
    assert max(point.eye[1] for point in way) == pytest.approx(1.4 * np.sin(0.4 * np.pi))
    np.testing.assert_allclose(np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0])), [18, 36, 54, 72])
