# SPDX-License-Identifier: Apache-2.0
"""What is in a recording, what the graph would use of it, and what would go wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from objreg_ros.bridge import from_msg, lenses
from objreg_ros.bridge.layout import table
from objreg_ros.data import Intrinsics
from objreg_ros.recording.inputs import Inputs
from objreg_ros.recording.mounts import camera_on_body, first_readable, frame_of, static_frames
from objreg_ros.recording.record import Record, Recording

SAMPLE = 60  # messages of colour and depth whose stamps are compared
NEAR_NS = 20_000_000  # how far apart colour and depth may be for the nodes' default slop


@dataclass(frozen=True, slots=True)
class Line:
    """One topic: how often it came, and what its first message is."""

    topic: str
    msgtype: str
    count: int
    rate: float | None
    what: str


def describe_topics(recording: Recording) -> list[Line]:
    """A line a topic, in order of name. The rate is None for fewer than two messages."""
    lines = []
    for topic in recording.topics.values():
        rate = (topic.count - 1) / recording.seconds if topic.count > 1 and recording.seconds > 0 else None
        lines.append(Line(topic.name, topic.msgtype, topic.count, rate, _what(recording, topic.name, topic.msgtype)))
    return lines


def describe_lens(recording: Recording, inputs: Inputs, rectified: str = "auto") -> str:
    """What the graph would assume of the lens of the camera; empty where there is no camera_info that can be read."""
    record = _first(recording, inputs.camera_info)
    message = None if record is None else record.read()
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
    camera = from_msg.intrinsics(message)
    numbers = " ".join(f"{name} {getattr(camera, name):.1f}" for name in ("fx", "fy", "cx", "cy"))
    return f"{camera.width} × {camera.height} {numbers}{', distorted' if lenses.is_distorted(message) else ''}"


def _pose(message: Any) -> str:
    word = from_msg.odometry(message)
    return f"{word.frame_id} → {word.child_frame_id or 'pose'}"


def _imu(message: Any) -> str:
    sample = from_msg.imu(message)
    measured = {
        "acceleration": sample.acceleration, "turns": sample.angular_velocity, "orientation": sample.orientation,
    }  # fmt: skip
    told = ", ".join(name for name, values in measured.items() if values is not None) or "nothing measured"
    return f"{told}, {message.header.frame_id}"


DESCRIBE: dict[str, Callable[[Any], str]] = {
    "sensor_msgs/msg/Image": _image,
    "sensor_msgs/msg/CompressedImage": _compressed,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "sensor_msgs/msg/CameraInfo": _camera,
    "sensor_msgs/msg/Imu": _imu,
    "nav_msgs/msg/Odometry": _pose,
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose,
    "geometry_msgs/msg/TransformStamped": _pose,
}


def warnings(recording: Recording, inputs: Inputs) -> list[str]:
    """What would go wrong or be missed, in words, and what to do; empty if nothing."""
    found = list(recording.notes)
    if inputs.missing:
        found.append(
            f"the graph cannot run: expected {inputs.missing}; if it is there, name it with --remap input:=/topic"
        )
    if inputs.odom is None:
        found.append("no odometry: the registrar follows the camera by itself, and the gate is less strict")
    if inputs.ground_truth is None:
        found.append("no ground truth: the true error of constraints cannot be told")
    found += [*_mount_of_camera(recording, inputs), *_mount_of_imu(recording, inputs)]
    return [*found, *_first_messages(recording, inputs), *_frames(recording, inputs), *_stamps(recording, inputs)]


def _first_messages(recording: Recording, inputs: Inputs) -> list[str]:
    """What the nodes would say of the first messages."""
    found: list[str] = []
    colour = _try(found, "image", recording, inputs.image, lambda m: from_msg.image(m).rgb.shape[:2])
    depth = _try(found, "depth", recording, inputs.depth, lambda m: from_msg.depth(m).shape)
    cloud = _try(found, "points", recording, inputs.points, from_msg.point_cloud)
    read = from_msg.intrinsics if cloud is None else partial(from_msg.camera_of_cloud, cloud=cloud)
    camera: Intrinsics | None = _try(found, "camera_info", recording, inputs.camera_info, read)
    if camera and depth and depth != (camera.height, camera.width):
        found.append(f"depth has {_size(depth)} pixels and its camera_info {camera.width} × {camera.height}")
    if colour and depth and colour != depth:
        found.append(
            f"colour has {_size(colour)} pixels and depth {_size(depth)}: they must show the same field of view"
        )
    if cloud is not None and not cloud.organised and camera is None:
        found.append("points are not organised and there is no camera_info to project them with")
    return found


def _try(
    found: list[str], name: str, recording: Recording, topic: str | None, decode: Callable[[Any], Any]
) -> Any | None:
    record = _first(recording, topic)
    try:
        return None if record is None else decode(record.message)
    except ValueError as error:
        found.append(f"{name}: {error}")
        return None


def _size(hw: tuple[int, int]) -> str:
    return f"{hw[1]} × {hw[0]}"


def _frames(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether a depth image is in the frame of colour, as one that is registered to it is."""
    colour, depth = (_frame_id(recording, topic) for topic in (inputs.image, inputs.depth))
    if not colour or not depth or colour == depth:
        return []
    return [
        f"colour is in the frame {colour} and depth in {depth}: depth that is not registered to colour gives wrong "
        "objects; record registered depth (RealSense: align_depth.enable:=true, OpenNI: depth_registered)"
    ]


def _mount_of_camera(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether it is known how the camera sits on the body of the odometry."""
    body, camera, T_body_camera = camera_on_body(recording, inputs)
    if body == camera or T_body_camera is not None:
        return []
    return [
        f"odometry is of {body} and depth in {camera}, and no /tf_static ties them: they are taken to be one place; "
        "set T_base_camera of registrar and mapper where they are not"
    ]


def _mount_of_imu(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether it is known how the IMU sits on the camera."""
    camera, imu = (_frame_id(recording, topic) for topic in (inputs.depth or inputs.points, inputs.imu))
    if not camera or not imu or camera == imu or static_frames(recording).between(camera, imu) is not None:
        return []
    return [
        f"the IMU is in the frame {imu} and depth in {camera}, and no /tf_static ties them: it tells gravity only with "
        "segmenter.T_camera_imu, its pose in the camera's optical frame"
    ]


def _frame_id(recording: Recording, topic: str | None) -> str:
    """The frame of a topic's first message; empty if it tells none."""
    return frame_of(first_readable(recording, topic))


def _stamps(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether the stamps in the headers let colour and depth be brought together."""
    topics = inputs.image, inputs.depth or inputs.points
    begins = [record.stamp_ns for topic in topics if (record := _first(recording, topic)) is not None]
    colour, depth = (_header_stamps(recording, topic, max(begins, default=0)) for topic in topics)
    found = []
    for name, stamps in (("colour", colour), ("depth", depth)):
        if (np.diff(stamps) < 0).any():
            found.append(f"the stamps of {name} go back in time: what waits is dropped there")
        if len(stamps) > 1 and (stamps == stamps[0]).all():
            found.append(
                f"the first {len(stamps)} stamps of {name} are all {stamps[0]} ns: frames are told apart by them, and "
                "none closes a loop; record it again with the time in its headers"
            )
    if len(begins) == len(topics) and not (len(colour) and len(depth)):
        found.append("colour and depth were recorded at different times: none goes with the other")
    if len(colour) and len(depth):
        apart = _apart_ns(colour, depth)
        if apart > NEAR_NS:
            found.append(f"colour and depth are {apart * 1e-6:.0f} ms apart: raise segmenter.slop above that")
    return found


def _apart_ns(colour: np.ndarray, depth: np.ndarray) -> float:
    """How far the stamps of the slower stream are from the nearest of the faster one; the median.

    Only those within the time of both count, unless there are none.
    """
    slow, fast = sorted((colour, depth), key=_pace)
    within = slow[(slow >= fast.min()) & (slow <= fast.max())]
    slow = within if len(within) else slow
    return float(np.median(np.abs(slow[:, None] - fast[None, :]).min(axis=1)))


def _pace(stamps: np.ndarray) -> float:
    """Stamps in a second; 0 for fewer than two."""
    step_ns = float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
    return 1e9 / step_ns if step_ns else 0.0


def _header_stamps(recording: Recording, topic: str | None, start_ns: int) -> np.ndarray:
    """The first `SAMPLE` stamps of what was recorded from a time on and decodes."""
    messages = (record.read() for record in recording.records([topic], start_ns)) if topic else iter(())
    readable = islice((message for message in messages if message is not None), SAMPLE)
    return np.array([from_msg.stamp_ns(message) for message in readable], np.int64)


def _first(recording: Recording, topic: str | None) -> Record | None:
    return next(recording.records([topic]), None) if topic else None
