# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from recording.sample_folders import humble_bag, noetic_bag, records, tum_folder
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from objreg_ros.bridge.messages import from_msg
from objreg_tools.cli.commands.convert import command
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.rosbag.bags import latched_qos


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_folder_becomes_a_rosbag2(storage: str, tmp_path: Path) -> None:
    words = [str(tum_folder(tmp_path / "tum")), str(tmp_path / "bag"), "--storage", storage]
    result = CliRunner().invoke(command, words)
    assert result.exit_code == 0 and "12 records" in result.output
    with open_recording(tmp_path / "bag") as bag:
        assert bag.kind == f"rosbag2 ({storage})" and bag.topics["/image"].count == 3


def test_a_rosbag1_becomes_a_rosbag2_with_the_same_points(shared: Path, tmp_path: Path) -> None:
    bag = shared / "data/bag_soda_can/perception_tutorial.bag"
    assert CliRunner().invoke(command, [str(bag), str(tmp_path / "bag")]).exit_code == 0
    with open_recording(bag) as old, open_recording(tmp_path / "bag") as new:
        before, after = next(old.records()), next(new.records())
        assert before.stamp_ns == after.stamp_ns
        clouds = [from_msg.point_cloud(record.message) for record in (before, after)]
        assert clouds[0].xyz.tobytes() == clouds[1].xyz.tobytes() and clouds[0].stamp_ns == clouds[1].stamp_ns


def test_topics_that_ros_2_does_not_have_are_left_out_by_name(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(noetic_bag(tmp_path / "one.bag")), str(tmp_path / "bag")])
    assert result.exit_code == 0 and "12 records" in result.output
    assert "left out: /tf (ROS 2 does not ship tf/msg/tfMessage)" in result.output
    assert "left out: /rosout (ROS 2 does not ship rosgraph_msgs/msg/Log)" in result.output
    assert "left out: /arm/0 (no valid name in ROS 2)" in result.output
    assert "left out: /markers (visualization_msgs/msg/Marker has no texture_resource, which" in result.output
    with open_recording(tmp_path / "bag") as bag:
        assert set(bag.topics) == {"/image", "/depth/image", "/camera_info", "/odom"}


def test_a_topic_whose_type_has_other_fields_in_jazzy_is_left_out_by_name(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(humble_bag(tmp_path / "old")), str(tmp_path / "bag")])
    assert result.exit_code == 0 and "2 records" in result.output
    assert "left out: /range (sensor_msgs/msg/Range has other fields than in ROS 2 Jazzy: variance)" in result.output
    with open_recording(tmp_path / "bag") as bag:
        assert set(bag.topics) == {"/chatter", "/nothing"}


def test_what_is_assumed_and_topics_without_messages_are_said(tmp_path: Path) -> None:
    (tum_folder(tmp_path / "tum") / "camera.yaml").unlink()
    result = CliRunner().invoke(command, [str(tmp_path / "tum"), str(tmp_path / "bag")])
    assert "! no camera.yaml: the benchmark's default camera is assumed" in result.output
    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "one.bag") as writer:
        writer.add_connection("/quiet", "std_msgs/msg/String", typestore=types)
    result = CliRunner().invoke(command, [str(tmp_path / "one.bag"), str(tmp_path / "empty")])
    assert result.exit_code == 0 and "left out: /quiet (no messages)" in result.output


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_latched_topic_stays_latched(storage: str, tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "tf", records(), offered_qos={"/odom": [latched_qos(1)]})
    words = [str(tmp_path / "tf"), str(tmp_path / "bag"), "--storage", storage]
    assert CliRunner().invoke(command, words).exit_code == 0
    with open_recording(tmp_path / "bag") as bag:
        assert bag.offered_qos() == {"/odom": [latched_qos(1)]}


def test_what_is_there_is_not_overwritten(tmp_path: Path) -> None:
    folder, out = tum_folder(tmp_path / "tum"), tmp_path / "out"
    out.mkdir()
    with pytest.raises(FileExistsError, match="expected a new folder"):
        CliRunner().invoke(command, [str(folder), str(out)], catch_exceptions=False)
