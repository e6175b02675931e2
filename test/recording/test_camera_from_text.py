# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.bridge.messages import camera_from_msg
from objreg_tools.recording import open_recording
from objreg_tools.recording.camera_from_text import GIVEN, with_camera
from objreg_tools.recording.inputs import CAMERA_INFO, choose_inputs

from .sample_folders import noetic_bag, robot_bag, tum_folder

CAMERA = "100,101,63.5,47.5,128,96"  # of twice the size


def bags(folder: Path) -> list[Path]:
    return [
        tum_folder(folder / "tum"), robot_bag(folder / "robot"), noetic_bag(folder / "noetic.bag"),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", range(3), ids=["tum", "rosbag2", "rosbag1"])
def test_the_camera_that_is_given_takes_the_place_of_any_other_in_the_size_of_the_pictures(
    kind: int, tmp_path: Path
) -> None:
    with open_recording(bags(tmp_path)[kind]) as opened:
        source = with_camera(opened, CAMERA)
        inputs = choose_inputs(source.topics)
        assert (inputs.camera_info, inputs.depth) == (GIVEN, "/depth/image") and inputs.complete
        assert [topic.name for topic in source.topics.values() if topic.msgtype == CAMERA_INFO] == [GIVEN]
        assert source.notes[-1] == "not used, as a camera is given: /camera_info"
        records = list(source.records(set(inputs.chosen().values())))
        assert [record.topic for record in records].count(GIVEN) == 1 and records[0].topic == GIVEN
        camera = camera_from_msg.intrinsics(records[0].message)
        assert (camera.fx, camera.fy, camera.cx, camera.width, camera.height) == (50, 50.5, 31.5, 64, 48)
        assert len(records[0].cdr) > 100 and records[0].message.header.frame_id == "camera"
        assert {record.topic for record in source.records()} == source.topics.keys()


def test_without_a_text_the_recording_is_what_it_was(tmp_path: Path) -> None:
    with open_recording(tum_folder(tmp_path / "tum")) as opened:
        assert with_camera(opened, "") is opened


def test_a_recording_from_later_on_keeps_the_camera_for_who_comes_late(tmp_path: Path) -> None:
    with open_recording(tum_folder(tmp_path / "tum")) as opened:
        source = with_camera(opened, CAMERA)
        later = source.start_ns + 1
        assert GIVEN in source.latched and GIVEN not in source.obstacles() and GIVEN not in source.offered_qos()
        assert [r.topic for r in source.records([GIVEN])] == [GIVEN] and not list(source.records([GIVEN], later))
        assert [r.topic for r in source.records([GIVEN], end_ns=later)] == [GIVEN]
        assert not list(source.records([]))


def test_pictures_of_another_shape_are_refused_with_the_topic(tmp_path: Path) -> None:
    with (
        open_recording(tum_folder(tmp_path / "tum")) as opened,
        pytest.raises(ValueError, match=r"/depth/image: camera: expected a picture of 640 × 360 .*, got 64 × 48"),
    ):
        with_camera(opened, "525,525,320,180,640,360")


def test_what_was_chosen_of_a_file_with_several_cameras_is_said(tmp_path: Path) -> None:
    one = "  camera_model: pinhole\n  intrinsics: [50.0, 50.0, 31.5, 23.5]\n  resolution: [64, 48]\n"
    (tmp_path / "chain.yaml").write_text(f"cam0:\n{one}cam1:\n{one}")
    chosen = with_camera(open_recording(tum_folder(tmp_path / "tum")), str(tmp_path / "chain.yaml"))
    assert any(note.startswith("chain.yaml: the file has several cameras: cam0 is used") for note in chosen.notes)
    assert chosen.of_pictures
