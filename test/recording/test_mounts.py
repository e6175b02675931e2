# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.bridge.camera.frames import FrameTie
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.mounts import TRANSFORMS, camera_on_body, frame_tree, static_topics
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.troubles import warnings

from .sample_folders import CAMERA, static

T_BODY_CAMERA = pose(rotation_from_vector(np.array([0.1, -1.2, 0.3])), np.array([0.2, 0.0, 0.5]))


def bag(place: Path, *more: Record, child: str = "base", camera: str = "eye") -> Path:
    """Depth of a camera and odometry of a body, and more."""
    odometry = messages.odometry(np.eye(4), np.eye(6), 1, "odom", child)
    depth = messages.image(np.full((48, 64), 1000, np.uint16), "16UC1", 1, camera)
    camera_info = messages.camera_info(CAMERA, 1, camera)
    said = {"/odom": odometry, "/depth/image": depth, "/camera_info": camera_info}
    write_rosbag2(place, [*(Record.of(topic, message, 1) for topic, message in said.items()), *more])
    return place


def test_the_camera_on_the_body_of_the_odometry_is_what_tf_static_says_whenever(tmp_path: Path) -> None:
    late = static("/base", "/eye", T_BODY_CAMERA, 99, "/robot/tf_static")
    with open_recording(bag(tmp_path / "bag", late)) as source:
        assert static_topics(source) == ["/robot/tf_static"] and source.topics["/robot/tf_static"].msgtype == TRANSFORMS
        body, camera, T, tie = camera_on_body(source, choose_inputs(source.topics))
        assert tie is FrameTie.STATIC
        assert (body, camera) == ("base", "eye") and pytest.approx(T_BODY_CAMERA, abs=1e-9) == T
        assert not [w for w in warnings(source, choose_inputs(source.topics)) if "tf_static" in w.text]


def test_a_body_that_nothing_ties_to_the_camera_is_stated_with_what_to_do(tmp_path: Path) -> None:
    with open_recording(bag(tmp_path / "bag")) as source:
        assert camera_on_body(source, choose_inputs(source.topics)) == ("base", "eye", None, None)
        assert frame_tree(source).between("base", "eye") is None
        (warning,) = [w for w in warnings(source, choose_inputs(source.topics)) if "tf_static" in w.text]
        assert warning.text.startswith("odometry is of base and depth in eye") and "set T_base_camera" in warning.text


@pytest.mark.parametrize("names", [{"child": ""}, {"camera": ""}, {"child": "eye"}])
def test_odometry_of_the_camera_itself_and_frames_without_a_name_are_no_trouble(
    names: dict[str, str], tmp_path: Path
) -> None:
    with open_recording(bag(tmp_path / "bag", **names)) as source:
        assert not [w for w in warnings(source, choose_inputs(source.topics)) if "tf_static" in w.text]
