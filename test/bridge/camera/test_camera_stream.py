# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from plausibility.box_room import depth_and_grey, longer, seen_as, swinging
from plausibility.moving import CAMERA, MOUNT

from objreg_ros.bridge.camera.camera_stream import CameraStream
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose_error

SECONDS = np.arange(0.0, 12.0, 0.1)
PATH = swinging(SECONDS)
BODY_PATH, OTHER_PATH = PATH @ inverse(MOUNT), swinging(SECONDS[::-1], pace=1.7) @ inverse(MOUNT)


@pytest.fixture(scope="module")
def pictures() -> list[tuple[Array, Array]]:
    return [depth_and_grey(T) for T in PATH]


def frame(k: int, picture: tuple[Array, Array], stated: Intrinsics) -> Frame:
    return Frame(
        objects=(),
        support=None,
        view=seen_as(*picture, stated),
        gravity=None,
        gravity_confidence=0.0,
        T_odom_camera=None,
        stamp_ns=round(1e9 * SECONDS[k]),
        frame_id="camera",
    )


Pictures = list[tuple[Array, Array]]


def run(
    stream: CameraStream, pictures: Pictures, T_odom_body: Array | None, stated: Intrinsics = CAMERA
) -> list[Frame]:
    """The frames with this odometry, as they are placed."""
    placed = []
    for k, picture in enumerate(pictures):
        taken = frame(k, picture, stated)
        beside = None if T_odom_body is None else [Odometry(T_odom_body=T_odom_body[k], stamp_ns=taken.stamp_ns)]
        if beside:
            stream.take_odometry(beside[0])
        placed.append(stream.place(taken, beside))
    return placed


def test_a_frame_has_the_pose_of_its_camera_and_is_proven_in_time(pictures: Pictures) -> None:
    stream = CameraStream(Mount(MOUNT))
    first, *_, last = run(stream, pictures, BODY_PATH)
    for placed, true in ((first, PATH[0]), (last, PATH[-1])):
        assert placed.T_odom_camera is not None
        degrees, centimetres = pose_error(placed.T_odom_camera, true)
        assert degrees < 0.01 and centimetres < 0.01
    assert not first.proven and last.proven and last.doubt == "" and stream.judge_rest() == ""
    assert stream.without_odometry == 0 and stream.findings == ()


def test_frames_of_a_camera_that_is_not_what_it_says_are_in_doubt(pictures: Pictures) -> None:
    stream = CameraStream(Mount(None))
    last = run(stream, pictures, None, longer(CAMERA, 1.3))[-1]
    assert "focal length" in last.doubt and not last.proven and stream.judge_rest() == last.doubt


def test_odometry_of_another_robot_is_left_out_once_it_is_known_to_be(pictures: Pictures) -> None:
    stream = CameraStream(Mount(MOUNT))
    placed = run(stream, pictures, OTHER_PATH @ inverse(MOUNT))
    assert placed[0].T_odom_camera is not None and placed[-1].T_odom_camera is None
    assert 0 < stream.without_odometry < len(PATH)


def test_a_mount_that_nothing_says_is_measured_and_used_and_said_once(pictures: Pictures) -> None:
    said: list[str] = []
    stream = CameraStream(Mount(None, FrameTree()), said.append)
    placed = run(stream, pictures, BODY_PATH)
    assert placed[0].T_odom_camera is None and placed[-1].T_odom_camera is not None
    assert stream.mount is not None and pose_error(stream.mount, MOUNT)[0] < 3.0
    assert len(said) == 1 and "T_base_camera:" in said[0]


@pytest.mark.parametrize("odometry", [None, BODY_PATH])
def test_a_mount_that_is_known_is_not_reported_as_measured(odometry: Array | None, pictures: Pictures) -> None:
    stream = CameraStream(Mount(MOUNT))
    run(stream, pictures, odometry)
    assert stream.mount is None
    assert stream.T_body_camera is None if odometry is None else np.array_equal(stream.T_body_camera, MOUNT)
