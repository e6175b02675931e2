# SPDX-License-Identifier: Apache-2.0
"""How the parts of a recorded robot sit on each other: all of the recording's /tf_static, and what its /tf repeats."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from typing import Any, NamedTuple

from objreg_ros.bridge.camera.chains import body_of
from objreg_ros.bridge.camera.frames import FrameTie, FrameTree
from objreg_ros.bridge.camera.mount import OdometryBody, nameless_body
from objreg_ros.data.checked import Array
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.record import Record, Recording
from objreg_tools.recording.topic_rules import CAMERA_INFO, PICTURES

TRANSFORMS = "tf2_msgs/msg/TFMessage"
OF_CAMERAS = (*PICTURES, "sensor_msgs/msg/PointCloud2", CAMERA_INFO)
TYPES = (TRANSFORMS, "tf/msg/tfMessage")  # the latter of early ROS 1
MOMENTS, LOOKED_AT = 12, 100  # at which /tf is looked at ahead, and messages of each


def static_topics(recording: Recording) -> list[str]:
    """The topics of a recording that are its /tf_static, in any namespace."""
    return [t.name for t in recording.topics.values() if t.msgtype in TYPES and t.name.endswith("tf_static")]


def moving_topics(recording: Recording) -> list[str]:
    """The topics of a recording that are its /tf, in any namespace."""
    return [t.name for t in recording.topics.values() if is_moving(t.name, t.msgtype)]


def is_moving(topic: str, msgtype: str) -> bool:
    """Whether a topic is a /tf, in any namespace."""
    return msgtype in TYPES and topic.split("/")[-1] == "tf"


def frame_tree(recording: Recording, *followed: str) -> FrameTree:
    """The frames of all of /tf_static, and of /tf at some times of the recording, without messages that do not decode.

    Of what is above the frames ``followed`` it is then known what moves.
    """
    tree, static = FrameTree(), static_topics(recording)
    tree.keep_history(*followed)
    for record in recording.records(static) if static else ():
        with suppress(ValueError):
            tree.add_transforms(record.message)
    for record in _glances(recording, moving_topics(recording)):
        with suppress(ValueError):
            tree.receive_moving(record.message)
    return tree


def _glances(recording: Recording, topics: list[str]) -> Iterator[Record]:
    """Records at some times, in order: all there are where these are few."""
    count = sum(recording.topics[topic].count for topic in topics)
    if count <= MOMENTS * LOOKED_AT:
        yield from recording.records(topics) if topics else ()
        return
    span_ns = recording.end_ns - recording.start_ns
    for k in range(MOMENTS):
        yield from islice(recording.records(topics, recording.start_ns + k * span_ns // MOMENTS), LOOKED_AT)


class Mounted(NamedTuple):
    """How the camera sits on the body of a recording's odometry.

    ``T_body_camera (4, 4)`` is None where a joint moves between them, or ``tie`` is None: nothing ties them. Both names
    are empty where one is not known, and where the odometry is of the camera itself.
    """

    body: str
    camera: str
    T_body_camera: Array | None
    tie: FrameTie | None


def camera_on_body(recording: Recording, inputs: Inputs) -> Mounted:
    """How the camera sits on the body of the odometry, by /tf_static and /tf."""
    odom, camera = first_readable(recording, inputs.odom), camera_frame(recording, inputs)
    if odom is None or not camera:
        return Mounted("", "", None, None)
    tree = frame_tree(recording, camera)
    body = getattr(odom, "child_frame_id", "").lstrip("/")
    if not body and nameless_body(inputs.odom or "", hasattr(odom, "child_frame_id")) is OdometryBody.BASE:
        body = body_of(tree, frame_of(odom), camera)
    if not body:
        return Mounted("", "", None, None)
    without = frame_of(odom)
    return Mounted(body, camera, tree.between(body, camera, None, without), tree.tie(body, camera, without))


def camera_frame(recording: Recording, inputs: Inputs) -> str:
    """The frame of depth; empty if it names none."""
    return frame_of(first_readable(recording, inputs.depth or inputs.points))


def first_readable(recording: Recording, topic: str | None) -> Any | None:
    """The first message of a topic; None where there is none, or where it does not decode."""
    record = next(recording.records([topic]), None) if topic in recording.topics else None
    return None if record is None else record.read()


def first_frames(recording: Recording) -> dict[str, str]:
    """The frame of the first message of every picture, cloud and camera_info: topic → frame, where it says one."""
    topics = [topic.name for topic in recording.topics.values() if topic.msgtype in OF_CAMERAS and topic.count]
    found = {topic: frame_of(first_readable(recording, topic)) for topic in topics}
    return {topic: frame for topic, frame in found.items() if frame}


def frame_of(message: Any | None) -> str:
    """The frame of a message; empty if it names none."""
    return "" if message is None else str(message.header.frame_id).lstrip("/")
