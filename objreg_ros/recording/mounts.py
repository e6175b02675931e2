# SPDX-License-Identifier: Apache-2.0
"""How the parts of a recorded robot sit on each other: all of the recording's /tf_static, whenever it was said."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from objreg_ros.bridge.static_frames import StaticFrames
from objreg_ros.data import Array
from objreg_ros.recording.inputs import Inputs
from objreg_ros.recording.record import Recording

TRANSFORMS = "tf2_msgs/msg/TFMessage"


def static_topics(recording: Recording) -> list[str]:
    """The topics of a recording that are its /tf_static, in any namespace."""
    return [t.name for t in recording.topics.values() if t.msgtype == TRANSFORMS and t.name.endswith("tf_static")]


def static_frames(recording: Recording) -> StaticFrames:
    """What they say; what does not decode is left out."""
    frames, topics = StaticFrames(), static_topics(recording)
    for record in recording.records(topics) if topics else ():
        with suppress(ValueError):
            frames.hear(record.message)
    return frames


def camera_on_body(recording: Recording, inputs: Inputs) -> tuple[str, str, Array | None]:
    """The frames of odometry's body and of depth, and ``T_body_camera (4, 4)`` by /tf_static; None where nothing ties
    them. Both names are empty where one is not told."""
    odom, depth = (first_readable(recording, topic) for topic in (inputs.odom, inputs.depth or inputs.points))
    body, camera = getattr(odom, "child_frame_id", "").lstrip("/"), frame_of(depth)
    if not body or not camera:
        return "", "", None
    return body, camera, static_frames(recording).between(body, camera)


def first_readable(recording: Recording, topic: str | None) -> Any | None:
    """The first message of a topic; None where there is none, or where it does not decode."""
    record = next(recording.records([topic]), None) if topic in recording.topics else None
    return None if record is None else record.read()


def frame_of(message: Any | None) -> str:
    """The frame of a message; empty if it tells none."""
    return "" if message is None else str(message.header.frame_id).lstrip("/")
