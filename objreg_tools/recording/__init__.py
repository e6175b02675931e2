# SPDX-License-Identifier: Apache-2.0
"""Recordings in and out, without ROS: rosbag1, rosbag2 and TUM RGB-D folders through one reader; rosbag2 out."""

from objreg_tools.recording.opening import open_recording
from objreg_tools.recording.record import Record, Recording, Topic
from objreg_tools.recording.rosbag.writer import write_rosbag2

__all__ = ["Record", "Recording", "Topic", "open_recording", "write_rosbag2"]
