# SPDX-License-Identifier: Apache-2.0
"""The way a camera is carried: speeds, smoothness, frame rate."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import is_rigid
from objreg_tools.simulation.trajectory import Hand, Waypoint, around, carried

from .motions import speeds

STEADY = Hand(tremor=0.0, shake=0.0)


def arc() -> list[Waypoint]:
    return around(np.array([1.0, 2.0, 0.8]), 1.2, 0.6, 0.0, 180.0)


def test_an_arc_keeps_its_distance_and_looks_at_its_centre() -> None:
    poses, _ = carried(arc(), 200, 30.0, np.random.default_rng(0), STEADY)
    away = np.array([1.0, 2.0, 0.8]) - poses[:, :3, 3]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.hypot(1.2, 0.6), atol=0.05)
    cosine = (away * poses[:, :3, 2]).sum(1) / np.linalg.norm(away, axis=1)
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 4.0


def test_every_pose_is_rigid_and_upright() -> None:
    poses, _ = carried(arc(), 50, 30.0, np.random.default_rng(0), Hand())
    assert all(is_rigid(T) for T in poses)
    assert (poses[:, 2, 1] < -0.5).all()  # the image's down points down


def test_the_camera_never_moves_faster_than_the_hand() -> None:
    poses, rate = carried(arc(), 120, 30.0, np.random.default_rng(0), STEADY)
    moved, turned = speeds(poses, rate)
    assert moved.max() <= STEADY.speed * 1.02 and turned.max() <= STEADY.turning * 1.02


def test_few_frames_bring_the_rate_down_and_many_leave_it() -> None:
    assert carried(arc(), 30, 30.0, np.random.default_rng(0), Hand())[1] < 10.0
    assert carried(arc(), 900, 30.0, np.random.default_rng(0), Hand())[1] == 30.0


def test_the_tremor_is_as_strong_as_stated() -> None:
    hand = Hand(tremor=0.004, shake=0.5)
    steady, _ = carried(arc(), 600, 30.0, np.random.default_rng(1), Hand(tremor=0.0, shake=0.0))
    shaken, _ = carried(arc(), 600, 30.0, np.random.default_rng(1), hand)
    assert (shaken - steady)[:, :3, 3].std() == pytest.approx(0.004, rel=0.3)


def test_a_way_of_one_point_is_refused_with_what_was_expected() -> None:
    with pytest.raises(ValueError, match="at least 2 frames and 2 waypoints, got 5 and 1"):
        carried(arc()[:1], 5, 30.0, np.random.default_rng(0), Hand())
