# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plausibility.spans import CAMERA
from plausibility.test_hand_eye import MOUNT
from plausibility.test_stream_monitor import BODY_PATH, OTHER_PATH, PATH, STEP_NS
from plausibility.views import view

from objreg_ros.bridge.camera_stream import CameraStream
from objreg_ros.bridge.frames import FrameTree
from objreg_ros.bridge.mount import Mount
from objreg_ros.data import Array, Frame, Intrinsics, Odometry
from objreg_ros.geometry import inverse, pose_error


def frame(k: int, stated: Intrinsics = CAMERA) -> Frame:
    return Frame(
        objects=(),
        support=None,
        view=view(PATH[k], stated),
        gravity=None,
        gravity_confidence=0.0,
        T_odom_camera=None,
        stamp_ns=k * STEP_NS,
        frame_id="camera",
    )


def run(stream: CameraStream, T_odom_body: Array | None, stated: Intrinsics = CAMERA) -> list[Frame]:
    """The frames of `PATH` with this odometry, as they are placed."""
    placed = []
    for k in range(len(PATH)):
        beside = None if T_odom_body is None else [Odometry(T_odom_body=T_odom_body[k], stamp_ns=k * STEP_NS)]
        if beside:
            stream.take_odometry(beside[0])
        placed.append(stream.place(frame(k, stated), beside))
    return placed


def test_a_frame_has_the_pose_of_its_camera_and_is_proven_in_time() -> None:
    stream = CameraStream(Mount(MOUNT))
    first, *_, last = run(stream, BODY_PATH)
    for placed, true in ((first, PATH[0]), (last, PATH[-1])):
        assert placed.T_odom_camera is not None
        degrees, centimetres = pose_error(placed.T_odom_camera, true)
        assert degrees < 0.01 and centimetres < 0.01
    assert not first.proven and last.proven and last.doubt == "" and stream.finish() == ""
    assert stream.without_odometry == 0 and stream.findings == ()


def test_frames_of_a_camera_that_is_not_what_it_says_are_in_doubt() -> None:
    stream = CameraStream(Mount(None))
    last = run(stream, None, replace(CAMERA, fx=1.3 * CAMERA.fx, fy=1.3 * CAMERA.fy))[-1]
    assert "focal length" in last.doubt and not last.proven and stream.finish() == last.doubt


def test_odometry_of_another_robot_is_left_out_once_it_is_known_to_be() -> None:
    stream = CameraStream(Mount(MOUNT))
    placed = run(stream, OTHER_PATH @ inverse(MOUNT))
    assert placed[0].T_odom_camera is not None and placed[-1].T_odom_camera is None
    assert 0 < stream.without_odometry < len(PATH)


def test_a_mount_that_nothing_says_is_measured_and_used_and_said_once() -> None:
    said: list[str] = []
    stream = CameraStream(Mount(None, FrameTree()), said.append)
    placed = run(stream, BODY_PATH)
    assert placed[0].T_odom_camera is None and placed[-1].T_odom_camera is not None
    assert stream.mount is not None and pose_error(stream.mount, MOUNT)[0] < 3.0
    assert len(said) == 1 and "T_base_camera:" in said[0]


@pytest.mark.parametrize("odometry", [None, BODY_PATH])
def test_a_mount_that_is_known_is_not_reported_as_measured(odometry: Array | None) -> None:
    stream = CameraStream(Mount(MOUNT))
    run(stream, odometry)
    assert stream.mount is None
    assert stream.T_body_camera is None if odometry is None else np.array_equal(stream.T_body_camera, MOUNT)
