# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np

from objreg_ros.bridge.messages import motion_from_msg
from objreg_tools.recording.folders.folder import FolderRecording, odometry_moment, pose_of_numbers, true_moment


def test_moments_come_in_order_of_time_and_as_they_are_asked_for(tmp_path: Path) -> None:
    moments = [odometry_moment(np.eye(4), 20), true_moment(np.eye(4), 10), odometry_moment(np.eye(4), 10)]
    recording = FolderRecording(tmp_path, moments, ["a note"])
    assert [(r.stamp_ns, r.topic) for r in recording.records()] == [(10, "/ground_truth"), (10, "/odom"), (20, "/odom")]
    assert [r.stamp_ns for r in recording.records(["/odom"], start_ns=11)] == [20]
    assert (recording.start_ns, recording.end_ns, recording.notes) == (10, 21, ["a note"])
    assert {name: topic.count for name, topic in recording.topics.items()} == {"/ground_truth": 1, "/odom": 2}


def test_the_y_axis_of_arkit_s_world_is_the_z_axis_of_odometry() -> None:
    up = np.eye(4)
    up[1, 3] = 2.0
    seen = motion_from_msg.odometry(odometry_moment(up, 5).make())
    assert np.allclose(seen.T_odom_body[:3, 3], (0, 0, 2)) and seen.stamp_ns == 5
    assert (seen.frame_id, seen.child_frame_id) == ("odom", "camera")


def test_numbers_that_are_no_pose_give_none() -> None:
    assert pose_of_numbers(np.array([1.0, 2, 3, 0, 0, 0, 0])) is None
    assert pose_of_numbers(np.array([np.nan, 2, 3, 0, 0, 0, 1])) is None
    T = pose_of_numbers(np.array([1.0, 2, 3, 0, 0, 0, 2]))
    assert T is not None and T[:3, 3].tolist() == [1, 2, 3] and np.allclose(T[:3, :3], np.eye(3))
