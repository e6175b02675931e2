# SPDX-License-Identifier: Apache-2.0
"""Keyframes of robots, each received on a topic of its own, and counted by robot."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from std_msgs.msg import String

from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe, keyframe
from objreg_ros.bridge.streams.frames_in import FramesNode
from objreg_ros.bridge.streams.key import Key
from objreg_ros.bridge.streams.keyframes_in import FromRobot, KeyframesIn

SENT = SentKeyframe(12_000_000_000, "camera", "0123456789abcdef" * 2, 0, 0, b"packed")
PREFIXES = {"fleet/r1": "r1/", "fleet/r2": "r2/"}


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FramesNode]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    rclpy.init(args=["registrar", "--ros-args", "-r", "__ns:=/fleet"])
    made = FramesNode("registrar")
    made.throttled._write = lambda line: None
    yield made
    made.close()
    rclpy.try_shutdown()


def test_each_camera_of_each_robot_has_a_topic(node: FramesNode) -> None:
    KeyframesIn(node, PREFIXES, [("front", "rear"), ()], lambda seen: None)
    received = {s.topic_name for s in node.subscriptions}
    keyframes = {topic for topic in received if topic.endswith("keyframes")}
    assert keyframes == {"/fleet/r1/front/keyframes", "/fleet/r1/rear/keyframes", "/fleet/r2/keyframes"}
    assert {"/fleet/r1/front/labels", "/fleet/r1/rear/labels", "/fleet/r2/labels"} <= received


def test_a_keyframe_is_handed_on_with_its_robot_and_is_counted(node: FramesNode) -> None:
    taken = list[FromRobot]()
    received = KeyframesIn(node, PREFIXES, [(), ()], taken.append)
    received._receive("fleet/r1", "r1/keyframes", keyframe(SENT))
    received.count("fleet/r1", "searched")
    assert taken == [FromRobot("fleet/r1", SENT)] and taken[0].nbytes == len(b"packed")
    assert node.accounting.balance().waiting == 1
    assert received.counts == {("fleet/r1", "received"): 1, ("fleet/r1", "searched"): 1}


def test_a_picture_is_dropped_and_counted_and_ends_nothing(node: FramesNode) -> None:
    taken = list[FromRobot]()
    received = KeyframesIn(node, PREFIXES, [(), ()], taken.append)
    message = keyframe(SENT)
    message.format = "jpeg"
    received._receive("fleet/r2", "r2/keyframes", message)
    balance = node.accounting.balance()
    assert taken == [] and balance.dropped == {"malformed_keyframes": 1} and balance.waiting == 0


def test_robots_may_call_one_number_otherwise(node: FramesNode) -> None:
    KeyframesIn(node, PREFIXES, [(), ()], lambda seen: None)
    for subscription in node.subscriptions:
        if subscription.topic_name.endswith("labels"):
            name = "cup" if "r1" in subscription.topic_name else "chair"
            subscription.callback(String(data=f'{{"1": "{name}"}}'), {"publication_sequence_number": 1})
    assert [node.names_of(robot) for robot in (*PREFIXES, "r3")] == [{1: "cup"}, {1: "chair"}, {}]


def test_of_two_cameras_of_a_robot_under_one_frame_the_first_is_taken_and_robots_may_share_frames(
    node: FramesNode,
) -> None:
    taken = list[FromRobot]()
    received = KeyframesIn(node, PREFIXES, [("front", "rear"), ()], taken.append)
    said = [("fleet/r1", "r1/front/keyframes", "camera"), ("fleet/r1", "r1/rear/keyframes", "fleet/r1/camera")]
    said += [("fleet/r2", "r2/keyframes", "camera"), ("fleet/r1", "r1/rear/keyframes", "rear_camera")]
    said += [("fleet/r1", "r1/front/keyframes", "camera")]
    for robot, topic, frame_id in said:
        received._receive(robot, topic, keyframe(SENT._replace(frame_id=frame_id)))
    frames = [(one.robot, one.sent.frame_id) for one in taken]
    assert frames == [
        ("fleet/r1", "camera"),
        ("fleet/r2", "camera"),
        ("fleet/r1", "rear_camera"),
        ("fleet/r1", "camera"),
    ]
    assert node.accounting.balance().dropped == {"same_camera": 1}


def test_with_a_key_a_keyframe_is_of_the_robot_on_whose_topic_it_was_signed(node: FramesNode) -> None:
    taken, key = list[FromRobot](), Key(b"0123456789abcdef")
    received = KeyframesIn(node, PREFIXES, [(), ()], taken.append, key)
    signed = key.sign("/fleet/r1/keyframes", keyframe(SENT))
    received._receive("fleet/r2", "r2/keyframes", signed)
    received._receive("fleet/r1", "r1/keyframes", keyframe(SENT))
    assert taken == [] and node.accounting.balance().dropped == {"malformed_keyframes": 2}
    received._receive("fleet/r1", "r1/keyframes", signed)
    assert taken == [FromRobot("fleet/r1", SENT)]
