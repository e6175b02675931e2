# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from bridge.trees import SECOND, moved, panning, said, transform, turned
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount, OdometryBody, Seat, nameless_body
from objreg_ros.data.frames import Odometry


def odometry_of(child: str) -> list[Odometry]:
    return [Odometry(T_odom_body=np.eye(4), child_frame_id=child, stamp_ns=1, frame_id="odom")]


def test_the_camera_sits_on_the_body_as_the_parameter_says_else_as_the_tree_does() -> None:
    frames, said_of_it = FrameTree(), list[str]()
    frames.add_transforms(said(transform("base", "eye", moved(1))))
    mount = Mount(None, frames, said_of_it.append)
    for _ in range(3):
        assert mount.T_body_camera(odometry_of("/base"), "eye") == pytest.approx(moved(1), abs=1e-9)
    (text,) = said_of_it
    assert text.startswith("/tf_static has the camera's 'eye' on the odometry's 'base' at ")
    assert Mount(moved(2), frames, said_of_it.append).T_body_camera(odometry_of("base"), "eye") is not None
    assert np.array_equal(Mount(moved(2), frames).T_body_camera(odometry_of("base"), "eye"), moved(2))
    assert len(said_of_it) == 1


def test_what_nothing_ties_is_one_place_and_said_once_and_again_where_that_changes() -> None:
    frames, said_of_it = FrameTree(), list[str]()
    mount = Mount(None, frames, said_of_it.append)
    assert [mount.T_body_camera(odometry_of("base"), "eye") for _ in range(3)] == [None] * 3
    (text,) = said_of_it
    assert "ties the odometry's 'base' to the camera's 'eye': the registrar measures it" in text
    frames.add_transforms(said(transform("base", "eye", moved(1))))
    assert mount.T_body_camera(odometry_of("base"), "eye") is not None and len(said_of_it) == 2


@pytest.mark.parametrize("child", [None, [], "eye", "/eye"])
def test_of_odometry_of_the_camera_itself_and_of_none_nothing_is_said(child: object) -> None:
    said_of_it = list[str]()
    mount = Mount(None, FrameTree(), said_of_it.append)
    assert mount.T_body_camera(odometry_of(child) if isinstance(child, str) else child, "eye") is None  # type: ignore[arg-type]
    assert said_of_it == []


def test_what_is_assumed_of_two_robots_in_turn_is_said_once_of_each() -> None:
    texts: list[str] = []
    mount = Mount(None, FrameTree(), texts.append)
    for robot in ("a", "b") * 3:
        odometry = Odometry(T_odom_body=np.eye(4), stamp_ns=0, child_frame_id=f"{robot}/base")
        mount.T_body_camera([odometry], f"{robot}/camera")
    assert len(texts) == 2 and "a/base" in texts[0] and "b/base" in texts[1]


def sample(odom: str, child: str, stamp_ns: int = SECOND) -> list[Odometry]:
    return [Odometry(T_odom_body=np.eye(4), child_frame_id=child, stamp_ns=stamp_ns, frame_id=odom)]


def test_a_joint_is_followed_to_the_moment_of_a_frame_and_beyond_its_history_nothing_is_known() -> None:
    texts = list[str]()
    mount = Mount(None, panning(0.0, 10.0), texts.append)
    assert mount.reached_ns is None
    T = mount.T_body_camera(sample("odom", "base"), "eye", SECOND + SECOND // 20)
    assert pytest.approx(turned(5.0) @ moved(1), abs=1e-9) == T
    assert mount.seated(sample("odom", "base"), "eye", 9 * SECOND) == (Seat.BEYOND, None)
    assert len(texts) == 1 and texts[0].endswith("by a joint, which is followed")
    assert mount.reached_ns == SECOND + SECOND // 10


def test_a_mount_that_tf_repeats_is_known_and_said_so() -> None:
    texts = list[str]()
    mount = Mount(None, panning(3.0, 3.0), texts.append)
    assert mount.seated(sample("odom", "base"), "eye", 50 * SECOND).seat is Seat.KNOWN
    assert texts[0].startswith("/tf repeats the camera's 'eye' on the odometry's 'base' at ")


def robot(*names: str) -> FrameTree:
    """A chain of frames, each static in the one before it."""
    tree = FrameTree()
    for k in range(1, len(names)):
        tree.add_transforms(said(transform(names[k - 1], names[k], moved(k))))
    return tree


def test_three_answers_are_kept_apart() -> None:
    mount = Mount(None, robot("base_link", "eye"))
    assert mount.seated(sample("odom", "base_link"), "eye").seat is Seat.KNOWN and not mount.unknown
    assert mount.seated(sample("odom", "eye"), "eye") == (Seat.ONE_PLACE, None) and not mount.unknown
    assert mount.seated(sample("odom", "other"), "eye") == (Seat.UNKNOWN, None) and mount.unknown
    assert mount.seated(None, "eye").seat is Seat.ONE_PLACE and not mount.unknown


def test_odometry_without_a_child_is_of_the_base_that_carries_the_camera() -> None:
    mount = Mount(None, robot("base_link", "mast", "eye"))
    assert mount.T_body_camera(sample("odom", ""), "eye") == pytest.approx(moved(1) @ moved(2), abs=1e-9)


def test_a_pose_without_a_child_is_the_cameras_where_its_topic_says_so_and_unknown_where_it_does_not() -> None:
    mount = Mount(None, robot("base_link", "eye"))
    mount.nameless = OdometryBody.CAMERA
    assert mount.seated(sample("odom", ""), "eye").seat is Seat.ONE_PLACE
    mount.nameless = OdometryBody.UNKNOWN
    assert mount.seated(sample("odom", ""), "eye").seat is Seat.UNKNOWN


@pytest.mark.parametrize(
    ("topic", "body"),
    [
        ("/slam/camera_pose", OdometryBody.CAMERA),
        ("/robot/camera/pose", OdometryBody.CAMERA),
        ("/orb_slam3/pose", OdometryBody.CAMERA),
        ("/robot_pose", OdometryBody.BASE),
        ("/mavros/local_position/pose", OdometryBody.BASE),
        ("/slam/pose", OdometryBody.UNKNOWN),
        ("odom/pose", OdometryBody.UNKNOWN),
    ],
)
def test_whose_pose_comes_on_a_topic_is_by_its_name(topic: str, body: OdometryBody) -> None:
    assert nameless_body(topic, has_child=False) is body and nameless_body(topic, has_child=True) is OdometryBody.BASE
