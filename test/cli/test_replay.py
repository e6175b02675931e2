# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from recording.folders import noetic_bag, robot_bag

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from objreg_ros.cli.replay import playable_names
from objreg_ros.recording import open_recording
from objreg_ros.recording.inputs import Inputs, choose_inputs

PLAYED = {"/camera_info", "/depth/image", "/image", "/odom"}


def test_a_topic_of_a_type_that_is_not_installed_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_recording(robot_bag(tmp_path / "bag")) as source:
        assert playable_names(source, choose_inputs(source.topics)) == {topic: topic for topic in PLAYED}
    assert capsys.readouterr().err == "left out: /meta (acme_msgs/msg/Meta is not installed)\n"


def test_what_ros_1_has_with_other_fields_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_recording(noetic_bag(tmp_path / "one.bag")) as source:
        assert set(playable_names(source, choose_inputs(source.topics))) == PLAYED
    said = capsys.readouterr().err
    assert "left out: /tf (ROS 2 does not ship tf/msg/tfMessage)" in said
    assert "left out: /markers (visualization_msgs/msg/Marker has no texture_resource" in said


def test_an_input_that_cannot_be_played_is_refused(tmp_path: Path) -> None:
    with (
        open_recording(robot_bag(tmp_path / "bag")) as source,
        pytest.raises(
            ValueError, match=r"expected inputs that can be published, got /meta \(acme_msgs/msg/Meta is not"
        ),
    ):
        playable_names(source, Inputs(image="/image", points="/meta"))
