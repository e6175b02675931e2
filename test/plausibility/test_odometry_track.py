# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data import Odometry
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.plausibility.odometry_track import OdometryTrack

MS = 1_000_000


def at(stamp_ms: int, x: float, yaw: float = 0.0) -> Odometry:
    T = pose(rotation_from_vector(np.array([0.0, 0.0, yaw])), np.array([x, 0.0, 0.0]))
    return Odometry(T_odom_body=T, stamp_ns=stamp_ms * MS, frame_id="odom", child_frame_id="base")


def test_a_pose_between_two_samples_is_between_them() -> None:
    track = OdometryTrack()
    for sample in (at(0, 0.0), at(100, 1.0, 0.4)):
        track.add(sample)
    T, known = track.at(np.array([25, 100]) * MS)
    assert known.all() and track.child_frame_id == "base" and track.span_ns == (0, 100 * MS)
    np.testing.assert_allclose(T[0], at(0, 0.25, 0.1).T_odom_body, atol=1e-3)
    np.testing.assert_allclose(T[1], at(0, 1.0, 0.4).T_odom_body, atol=1e-9)


def test_nothing_is_known_outside_of_the_samples_nor_across_a_long_gap() -> None:
    track = OdometryTrack()
    for sample in (at(0, 0.0), at(100, 0.0), at(2000, 0.0)):
        track.add(sample)
    assert track.at(np.array([-1, 50, 1000, 2001]) * MS)[1].tolist() == [False, True, False, False]


def test_a_clock_that_goes_back_begins_anew_and_samples_close_by_are_left_out() -> None:
    track = OdometryTrack()
    for sample in (at(5000, 0.0), at(1000, 1.0), at(1001, 2.0), at(1100, 3.0)):
        track.add(sample)
    assert len(track) == 2 and track.span_ns == (1000 * MS, 1100 * MS)


def test_before_any_sample_nothing_is_known() -> None:
    track = OdometryTrack()
    assert not track.at(np.array([0]))[1].any()
    with pytest.raises(ValueError, match="got none"):
        _ = track.span_ns
