# SPDX-License-Identifier: Apache-2.0
"""What a segmenter says, received by its parts: frames with odometry and names."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from registration.samples import SECOND, box, frame

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.streams.frames_in import FramesNode
from objreg_ros.bridge.streams.sync import Match
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import pose

PATIENCE = 20.0  # seconds; a test that gets there has failed
CUP = (box("cup", (0, 0, 1)),)
T_ODOM_BODY = pose(np.eye(3), np.array([1.0, 2.0, 3.0]))
T_BODY_CAMERA = pose(np.eye(3), np.array([0.1, 0.0, 0.0]))


class Frames(FramesNode):
    """Keeps the frames that it receives."""

    def __init__(self) -> None:
        super().__init__("frames")
        self.said = list[str]()
        self.throttled._write = self.said.append
        self.taken = list[tuple[Frame, Array | None]]()
        self.done = threading.Semaphore(0)
        self.listen_to_frames(T_BODY_CAMERA, 0.02)

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        try:
            self.taken.append(self.frame_of(payload))
            return True
        finally:
            self.done.release()


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Frames]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    rclpy.init(args=[])
    made = Frames()
    yield made
    made.close()
    rclpy.try_shutdown()


def send(node: Frames, seen: Frame, names: dict[int, str]) -> None:
    node._receive("objects")(to_msg.objects(seen, names))
    node._receive("view")(to_msg.view(seen))
    node._receive("view/camera_info")(to_msg.view_camera_info(seen))
    node._receive("gravity")(to_msg.gravity(seen))
    assert node.done.acquire(timeout=PATIENCE)


def test_a_frame_comes_with_its_names_and_the_pose_that_odometry_has_of_its_camera(node: Frames) -> None:
    node.receive_labels(to_msg.labels({3: "cup"}))
    odometry = Odometry(T_odom_body=T_ODOM_BODY, stamp_ns=5 * SECOND, frame_id="r1/odom")
    node._on_odom(to_msg.odometry(odometry))
    send(node, frame(5, CUP), {3: "cup"})
    ((seen, T_body_camera),) = node.taken
    assert [item.label for item in seen.objects] == ["cup"] and node.odom_frame == "r1/odom"
    assert np.allclose(seen.T_odom_camera, T_ODOM_BODY @ T_BODY_CAMERA)
    assert T_body_camera is not None and np.allclose(T_body_camera, T_BODY_CAMERA)
    assert node.without_odometry == 0 and node.names_of("") == {3: "cup"}


def test_names_that_come_later_are_added_to_those_that_are_known(node: Frames) -> None:
    for names in ({3: "cup"}, {4: "book"}, {3: "mug"}):
        node.receive_labels(to_msg.labels(names))
    assert node.names_of("") == {3: "mug", 4: "book"}


def test_frames_of_two_cameras_are_reported_with_what_to_do(node: Frames) -> None:
    for frame_id in ("front", "front", "rear", "front"):
        node._watch_camera(frame_id)
    (line,) = node.said
    assert "got one of 'rear' after one of 'front'" in line and "give each camera a keyframer" in line


def test_a_frame_that_breaks_its_contract_is_dropped_and_counted(node: Frames) -> None:
    node.receive_labels(to_msg.labels({3: "cup"}))
    seen = frame(5, CUP)
    message = to_msg.objects(seen, {3: "cup"})
    message.fields = message.fields[:-1]
    parts = {
        "view": to_msg.view(seen),
        "view/camera_info": to_msg.view_camera_info(seen),
        "gravity": to_msg.gravity(seen),
    }
    for topic, part in {"objects": message, **parts}.items():
        node._receive(topic)(part)
    assert node.done.acquire(timeout=PATIENCE)
    node.worker.close()
    assert node.accounting.balance().dropped == {"malformed_frame": 1}
