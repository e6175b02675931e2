# SPDX-License-Identifier: Apache-2.0
"""Odometry is asked for between its samples."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.plausibility.odometry_track import APART_NS, MOST_GAP_S, MOST_SAMPLES, OdometryTrack

STEP_NS = 10**8


def sample(stamp_ns: int, forward_m: float = 0.0, yaw: float = 0.0, child: str = "base_link") -> Odometry:
    T = pose(rotation_from_vector(np.array([0.0, 0.0, yaw])), np.array([forward_m, 0.0, 0.0]))
    return Odometry(T_odom_body=T, stamp_ns=stamp_ns, child_frame_id=child)


def track(*samples: Odometry) -> OdometryTrack:
    odometry = OdometryTrack()
    for one in samples:
        odometry.add_odometry(one)
    return odometry


def test_poses_between_samples_are_interpolated_and_those_at_samples_are_theirs() -> None:
    odometry = track(*(sample(k * STEP_NS, 0.2 * k, 0.1 * k) for k in range(5)))
    T, known = odometry.at(np.array([0, STEP_NS, STEP_NS * 5 // 2, 4 * STEP_NS]))
    assert known.all()
    expected = [sample(0, forward, yaw).T_odom_body for forward, yaw in ((0, 0), (0.2, 0.1), (0.5, 0.25), (0.8, 0.4))]
    np.testing.assert_allclose(T, expected, atol=1e-12)


@pytest.mark.parametrize(("before", "after", "between"), [(3.1, -3.1, np.pi), (-1.5, -1.7, -1.6), (1.5, 1.7, 1.6)])
def test_turns_are_interpolated_the_short_side(before: float, after: float, between: float) -> None:
    T, _ = track(sample(0, yaw=before), sample(STEP_NS, yaw=after)).at(np.array([STEP_NS // 2]))
    np.testing.assert_allclose(T[0], sample(0, yaw=between).T_odom_body, atol=1e-9)


def test_nothing_is_known_before_the_first_and_after_the_last_sample() -> None:
    T, known = track(sample(STEP_NS, 1.0), sample(2 * STEP_NS, 1.0)).at(np.array([STEP_NS - 1, 2 * STEP_NS + 1]))
    assert not known.any()
    np.testing.assert_array_equal(T, np.broadcast_to(np.eye(4), (2, 4, 4)))


def test_nothing_is_known_within_a_long_gap() -> None:
    gap_ns = round(1e9 * MOST_GAP_S)
    odometry = track(sample(0), sample(gap_ns), sample(2 * gap_ns + STEP_NS), sample(2 * gap_ns + 2 * STEP_NS))
    _, known = odometry.at(np.array([gap_ns // 2, gap_ns * 3 // 2, 2 * gap_ns + STEP_NS + 1]))
    assert known.tolist() == [True, False, True]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_samples_say_nothing(count: int) -> None:
    T, known = track(*[sample(0, 1.0)] * count).at(np.array([0, 1]))
    assert T.shape == (2, 4, 4) and not known.any()


def test_samples_that_are_near_in_time_are_left_out() -> None:
    odometry = track(sample(0), sample(APART_NS - 1), sample(APART_NS), sample(APART_NS))
    assert len(odometry) == 2 and odometry.span_ns == (0, APART_NS)


def test_a_clock_that_goes_back_begins_anew() -> None:
    odometry = track(sample(10 * STEP_NS), sample(11 * STEP_NS), sample(STEP_NS, 1.0), sample(2 * STEP_NS, 2.0))
    assert odometry.span_ns == (STEP_NS, 2 * STEP_NS)
    T, known = odometry.at(np.array([STEP_NS * 3 // 2, 10 * STEP_NS]))
    assert known.tolist() == [True, False] and T[0, 0, 3] == pytest.approx(1.5)


def test_a_sample_that_comes_after_a_question_counts_in_the_next_answer() -> None:
    odometry = track(sample(0), sample(STEP_NS))
    assert not odometry.at(np.array([2 * STEP_NS]))[1].any()
    odometry.add_odometry(sample(2 * STEP_NS, 3.0))
    assert odometry.at(np.array([2 * STEP_NS]))[0][0, 0, 3] == 3.0


def test_the_newest_samples_are_kept() -> None:
    one = sample(0)
    odometry = track(one)
    for k in range(1, MOST_SAMPLES + 5):
        odometry.add_odometry(Odometry(T_odom_body=one.T_odom_body, stamp_ns=k * APART_NS))
    assert len(odometry) == MOST_SAMPLES and odometry.span_ns == (5 * APART_NS, (MOST_SAMPLES + 4) * APART_NS)


def test_the_frames_are_those_of_the_last_sample_and_a_span_needs_one() -> None:
    odometry = track(sample(0, child="base_link"), sample(STEP_NS, child="base_footprint"))
    assert (odometry.frame_id, odometry.child_frame_id) == ("odom", "base_footprint")
    with pytest.raises(ValueError, match="expected samples of odometry, got none"):
        _ = OdometryTrack().span_ns
