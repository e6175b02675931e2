# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from objreg_tools.recording import Record
from objreg_tools.recording.poses import passed_over, pose_of
from objreg_tools.recording.rosbag import messages

from .sample_folders import lost


def seen() -> Record:
    return Record.of("/truth", messages.pose_stamped(np.eye(4), 7, "world"), 7)


def test_a_record_of_a_pose_gives_it() -> None:
    sample = pose_of(seen())
    assert sample is not None and sample.stamp_ns == 7 and np.array_equal(sample.T_odom_body, np.eye(4))


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf")])
def test_what_a_motion_capture_says_while_it_sees_nothing_is_no_pose(value: float) -> None:
    assert pose_of(lost(seen(), value)) is None


def test_what_does_not_decode_is_no_pose() -> None:
    def decode() -> None:
        raise ValueError("expected a whole bag")

    broken: Callable[[], bytes] = bytes
    assert pose_of(Record("/truth", "geometry_msgs/msg/PoseStamped", 7, decode, broken)) is None


def test_poses_that_were_passed_over_are_counted_for_the_user() -> None:
    (note,) = passed_over(2, 40, "the ground truth /vicon")
    assert "2 of 40 poses of the ground truth /vicon are none" in note
    assert passed_over(0, 40, "odometry") == []
