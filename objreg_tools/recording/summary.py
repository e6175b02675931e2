# SPDX-License-Identifier: Apache-2.0
"""The content of a recording, and the part that the graph would use."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.messages import camera_from_msg, motion_from_msg, vision_from_msg
from objreg_ros.bridge.messages.layout import table
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import first_readable
from objreg_tools.recording.record import Recording


@dataclass(frozen=True, slots=True)
class SummaryLine:
    """One topic: how often it came, and what its first message is."""

    topic: str
    msgtype: str
    count: int
    rate: float | None
    what: str


def describe_topics(recording: Recording) -> list[SummaryLine]:
    """A line a topic, in order of name. The rate is None for fewer than two messages."""
    lines = []
    for topic in recording.topics.values():
        rate = (topic.count - 1) / recording.seconds if topic.count > 1 and recording.seconds > 0 else None
        lines.append(
            SummaryLine(topic.name, topic.msgtype, topic.count, rate, _what(recording, topic.name, topic.msgtype))
        )
    return lines


def describe_lens(recording: Recording, inputs: Inputs, rectified: str = "auto") -> str:
    """The lens that the graph would assume for the camera; empty where there is no camera_info that can be read."""
    message = first_readable(recording, inputs.camera_info)
    if message is None:
        return ""
    raw = lenses.raw_pictures(rectified, inputs.depth or inputs.points, inputs.image)
    try:
        return lenses.describe(message, raw, points=inputs.points is not None)
    except ValueError as error:
        return f"not usable, and frames would be dropped: {error}"


def _what(recording: Recording, name: str, msgtype: str) -> str:
    describe = DESCRIBE.get(msgtype)
    record = next(recording.records([name]), None) if describe else None
    if describe is None or record is None:
        return ""
    try:
        return describe(record.message)
    except ValueError as error:
        return f"not readable: {error}"


def _image(message: Any) -> str:
    return f"{message.width} × {message.height} {message.encoding}, {message.header.frame_id}"


def _compressed(message: Any) -> str:
    return f"{message.format}, {message.header.frame_id}"


def _cloud(message: Any) -> str:
    names = " ".join(table(message).dtype.names or ())
    kind = "organised" if min(message.width, message.height) > 1 else "not organised"
    size = f"{message.width} × {message.height}"
    return f"{size} {kind}, {names}, {message.point_step} bytes a point, {message.header.frame_id}"


def _camera(message: Any) -> str:
    camera = camera_from_msg.intrinsics(message)
    numbers = " ".join(f"{name} {getattr(camera, name):.1f}" for name in ("fx", "fy", "cx", "cy"))
    return f"{camera.width} × {camera.height} {numbers}{', distorted' if lenses.is_distorted(message) else ''}"


def _pose(message: Any) -> str:
    odometry = motion_from_msg.odometry(message)
    return f"{odometry.frame_id} → {odometry.child_frame_id or 'pose'}"


def _imu(message: Any) -> str:
    sample = motion_from_msg.imu(message)
    measured = {
        "acceleration": sample.acceleration, "turns": sample.angular_velocity, "orientation": sample.orientation,
    }  # fmt: skip
    names = ", ".join(name for name, values in measured.items() if values is not None) or "nothing measured"
    return f"{names}, {message.header.frame_id}"


def _boxes(message: Any) -> str:
    labels = Counter(vision_from_msg.boxes(message, {}, (1, 1)).label)
    return f"{len(message.detections)} boxes: {', '.join(sorted(labels))[:80]}" if labels else "no boxes"


DESCRIBE: dict[str, Callable[[Any], str]] = {
    "sensor_msgs/msg/Image": _image,
    "sensor_msgs/msg/CompressedImage": _compressed,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "sensor_msgs/msg/CameraInfo": _camera,
    "sensor_msgs/msg/Imu": _imu,
    "nav_msgs/msg/Odometry": _pose,
    "vision_msgs/msg/Detection2DArray": _boxes,
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose,
    "geometry_msgs/msg/TransformStamped": _pose,
}
