# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from recording.sample_folders import CAMERA, lost, tum_folder
from recording.vision import detected_bag
from rosbags.rosbag2 import StoragePlugin, Writer

from objreg_ros.memory.store import Store
from objreg_tools.cli import group
from objreg_tools.cli.commands.inspect import columns, command
from objreg_tools.recording import Record, write_rosbag2
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.rosbag.messages import standard_types


def test_a_recording_is_described_with_its_inputs_and_its_truth(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tum_folder(tmp_path))])
    assert result.exit_code == 0
    for text in ("TUM RGB-D folder, 0.20 s", "sensor_msgs/Image", "64 × 48 16UC1, camera", "3 poses, 1.00 m"):
        assert text in result.output
    assert "! no odometry" in result.output


def test_detections_that_were_recorded_are_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(detected_bag(tmp_path / "bag"))], catch_exceptions=False)
    assert "1 boxes: 4" in result.output
    for topic in ("/yolo/detections", "/yolo/instance_masks"):
        assert f"--detections {topic} runs with them, with the names of /yolo/label_info" in result.output
    assert "--detections" not in CliRunner().invoke(command, [str(tum_folder(tmp_path / "tum"))]).output


def test_poses_of_the_truth_that_are_none_are_counted(tmp_path: Path) -> None:
    truth = Record.of("/gt", messages.pose_stamped(np.eye(4), 10**9, "world"), 10**9)
    write_rosbag2(tmp_path / "bag", [truth, lost(truth)])
    result = CliRunner().invoke(command, [str(tmp_path / "bag")])
    assert "1 poses, 0.00 m" in result.output
    assert "! 1 of 2 poses of the ground truth /gt are none" in result.output


def test_a_broken_picture_is_no_end_of_the_inspection(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    for place in ("rgb", "depth"):
        (folder / place / "0.000000.png").write_bytes(b"no png")
    result = CliRunner().invoke(command, [str(folder)])
    assert result.exit_code == 0 and "not readable: " in result.output


def test_a_recording_without_records_begins_at_no_time(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", [])
    output = CliRunner().invoke(command, [str(tmp_path / "bag")]).output
    assert "0.00 s, 0 records" in output and "UTC" not in output


def test_a_topic_of_two_types_is_listed_by_its_more_frequent_one(tmp_path: Path) -> None:
    types = standard_types()
    image = messages.image(np.zeros((4, 6, 3), np.uint8), "rgb8", 5, "c")
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for kind, count in (("sensor_msgs/msg/Image", 2), ("std_msgs/msg/String", 1)):
            connection = writer.add_connection("/x", kind, typestore=types)
            made = image if count == 2 else types.types[kind](data="x")
            for _ in range(count):
                writer.write(connection, 5, types.serialize_cdr(made, kind))
    output = CliRunner().invoke(command, [str(tmp_path / "bag")], catch_exceptions=False).output
    assert "6 × 4 rgb8, c" in output and "! /x is sensor_msgs/msg/Image and also std_msgs/msg/String: its 1" in output


def test_a_remap_shows_in_the_inputs(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tum_folder(tmp_path)), "--remap", "depth:="])
    assert "! the graph cannot run: expected points or a depth image" in result.output


def test_a_real_bag_is_described(shared: Path) -> None:
    result = CliRunner().invoke(command, [str(shared / "data/bag_soda_can/perception_tutorial.bag")])
    assert "640 × 480 organised, x y z rgb, 32 bytes a point" in result.output
    assert "expected a colour image" in result.output


@pytest.mark.parametrize("name", ["nowhere/map.png", "map.xyz"])
def test_a_picture_that_cannot_be_drawn_is_not_said_to_be(name: str, tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    result = CliRunner().invoke(group, ["inspect", str(tmp_path / "place.db"), "--picture", str(tmp_path / name)])
    assert isinstance(result.exception, OSError) and "drawn into" not in result.output


def test_a_picture_of_a_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"--picture: expected a store of the registrar, .* got .*tum"):
        words = [str(tum_folder(tmp_path / "tum")), "--picture", str(tmp_path / "q.png")]
        CliRunner().invoke(command, words, catch_exceptions=False)


def test_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such file"):
        CliRunner().invoke(command, [str(tmp_path / "x")], catch_exceptions=False)


def test_columns_line_up() -> None:
    assert columns(("a", "b"), [("long", "x")]) == "a     b\n----  -\nlong  x"


def test_what_is_assumed_of_the_lens_is_stated(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    assert "lens: none stated: taken as rectified" in CliRunner().invoke(command, [str(folder)]).output
    with (folder / "camera.yaml").open("a") as file:
        file.write("\ndistortion: [-0.3, 0.1, 0, 0, 0]\n")
    output = CliRunner().invoke(command, [str(folder)]).output
    assert "lens: plumb_bob, moves a pixel by " in output and "at most; rectified" in output


def test_a_lens_that_cannot_be_undone_is_reported_with_what_to_do(tmp_path: Path) -> None:
    info = messages.camera_info(CAMERA, 10**9, "camera", (0.1,) * 5)
    info.distortion_model = "nobody's"
    write_rosbag2(tmp_path / "bag", [Record.of("/camera_info", info, 10**9)])
    output = CliRunner().invoke(command, [str(tmp_path / "bag")]).output
    assert "lens: not usable, and frames would be dropped: camera_info: lens: expected a distortion model" in output


def test_a_camera_that_is_given_is_what_the_graph_would_use(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tum_folder(tmp_path / "tum")), "--camera", "50,50,31.5,23.5"])
    assert result.exit_code == 0 and "64 × 48 fx 50.0 fy 50.0" in result.output
    assert "! not used, as a camera is given: /camera_info" in result.output


def test_what_the_graph_cannot_run_on_ends_with_three(tmp_path: Path) -> None:
    folder = str(tum_folder(tmp_path))
    for words, code in (([], 0), (["--remap", "image:="], 3)):
        assert CliRunner().invoke(command, [folder, *words], standalone_mode=False).return_value == code
