# SPDX-License-Identifier: Apache-2.0
"""Bags that hold what another detector found, with the message types of vision_msgs 4."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from objreg_tools.recording import Record
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.rosbag.vision_types import DEFINITIONS, PACKAGE, define_vision

from .sample_folders import records


@cache
def vision_types() -> Typestore:
    types = get_typestore(Stores.ROS2_JAZZY)
    define_vision(types, [f"{PACKAGE}Detection2DArray"])
    return types


def boxes(stamp_ns: int, label: str = "4") -> Any:
    """A Detection2DArray of one box, of rows 12 to 24 and columns 20 to 40."""
    made = {name: vision_types().types[f"vision_msgs/msg/{name}"] for name in DEFINITIONS}
    head = messages.header(stamp_ns, "camera")
    middle = made["Pose2D"](position=made["Point2D"](x=30.0, y=18.0), theta=0.0)
    pose = messages.message("geometry_msgs/PoseWithCovariance", pose=messages.pose(np.eye(4)), covariance=np.zeros(36))
    best = made["ObjectHypothesisWithPose"](hypothesis=made["ObjectHypothesis"](class_id=label, score=0.75), pose=pose)
    bbox = made["BoundingBox2D"](center=middle, size_x=20.0, size_y=12.0)
    one = made["Detection2D"](header=head, results=[best], bbox=bbox, id="7")
    return made["Detection2DArray"](header=head, detections=[one])


def names(stamp_ns: int) -> Any:
    """A LabelInfo by which 4 is a mug."""
    made = vision_types().types
    one = made["vision_msgs/msg/VisionClass"](class_id=4, class_name="mug")
    head = messages.header(stamp_ns, "camera")
    return made["vision_msgs/msg/LabelInfo"](header=head, class_map=[one], threshold=0.0)


def masks(stamp_ns: int) -> Any:
    """An Image of masks: instance 4 in rows 12 to 24 and columns 20 to 40."""
    numbers = np.zeros((48, 64), np.uint8)
    numbers[12:24, 20:40] = 4
    return messages.image(numbers, "mono8", stamp_ns, "camera")


def detected(frames: int = 4, late_ns: int = 250_000_000) -> list[Record]:
    """`records` with boxes and masks of each picture, that come late as those of a slow detector, and their names."""
    found = [Record.of("/yolo/label_info", names(5), 5)]
    for record in records(frames):
        found.append(record)
        if record.topic == "/image":
            late = record.stamp_ns + late_ns
            found.append(Record.of("/yolo/detections", boxes(record.stamp_ns), late))
            found.append(Record.of("/yolo/instance_masks", masks(record.stamp_ns), late))
    return sorted(found, key=lambda record: record.stamp_ns)


def detected_bag(path: Path, frames: int = 4, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """A rosbag2 of `detected`, with the definitions of its types."""
    types = vision_types()
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections: dict[str, Any] = {}
        for record in detected(frames):
            if record.topic not in connections:
                connections[record.topic] = writer.add_connection(record.topic, record.msgtype, typestore=types)
            data = types.serialize_cdr(record.message, record.msgtype)
            writer.write(connections[record.topic], record.stamp_ns, data)
    return path
