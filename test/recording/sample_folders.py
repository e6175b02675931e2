# SPDX-License-Identifier: Apache-2.0
"""Small recordings for tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from objreg_ros.data.images import Intrinsics
from objreg_tools.recording import Record
from objreg_tools.recording.rosbag import messages

CAMERA = Intrinsics(fx=50.0, fy=50.0, cx=31.5, cy=23.5, width=64, height=48)
STEP_NS = 100_000_000


def tum_folder(path: Path, frames: int = 3, scale: float = 1000, lists: bool = False, lag: float = 0.0) -> Path:
    """A TUM RGB-D folder: frame i is of grey 10 i at i/10 s and 1 m + 0.1 m · i away."""
    (path / "rgb").mkdir(parents=True)
    (path / "depth").mkdir()
    pairs, truth = [], ["# timestamp tx ty tz qx qy qz qw"]
    for i in range(frames):
        t, d = i / 10, i / 10 + lag
        colour, depth = f"rgb/{t:.6f}.png", f"depth/{d:.6f}.png"
        cv2.imwrite(str(path / colour), np.full((48, 64, 3), (10 * i, 0, 200), np.uint8))
        cv2.imwrite(str(path / depth), np.full((48, 64), (1 + 0.1 * i) * scale, np.uint16))
        pairs.append((f"{t:.6f} {colour}", f"{d:.6f} {depth}"))
        truth.append(f"{t:.6f} {0.5 * i} 0 0 0 0 0 1")
    if lists:
        for k, name in enumerate(("rgb", "depth")):
            (path / f"{name}.txt").write_text("# a comment\n" + "\n".join(pair[k] for pair in pairs))
    else:
        (path / "associations.txt").write_text("\n".join(f"{a} {b}" for a, b in pairs))
    (path / "groundtruth.txt").write_text("\n".join(truth))
    camera = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "depth_scale": scale}
    (path / "camera.yaml").write_text("\n".join(f"{name}: {value}" for name, value in camera.items()))
    return path


def numbered_folder(path: Path, greys: Mapping[str, int]) -> Path:
    """A TUM RGB-D folder of nothing but small pictures: by the names of their times, colour of a grey and depth."""
    (path / "rgb").mkdir(parents=True)
    (path / "depth").mkdir()
    for name, grey in greys.items():
        cv2.imwrite(str(path / f"rgb/{name}.png"), np.full((4, 4, 3), grey, np.uint8))
        cv2.imwrite(str(path / f"depth/{name}.png"), np.full((4, 4), 5000, np.uint16))
    return path


def records(frames: int = 3) -> Iterator[Record]:
    """Colour and depth with camera_info and odometry, every tenth of a second from 1 s."""
    for i in range(frames):
        stamp_ns = 10**9 + i * STEP_NS
        T_odom_body = np.eye(4)
        T_odom_body[0, 3] = 0.1 * i
        yield Record.of("/camera_info", messages.camera_info(CAMERA, stamp_ns, "camera"), stamp_ns)
        odometry = messages.odometry(T_odom_body, np.eye(6), stamp_ns, "odom", "camera")
        yield Record.of("/odom", odometry, stamp_ns)
        rgb = np.full((48, 64, 3), (i, 20, 30), np.uint8)
        yield Record.of("/image", messages.image(rgb, "rgb8", stamp_ns, "camera"), stamp_ns)
        depth = np.full((48, 64), 1000 + i, np.uint16)
        yield Record.of("/depth/image", messages.image(depth, "16UC1", stamp_ns, "camera"), stamp_ns)


def static(parent: str, child: str, T_parent_child: np.ndarray, stamp_ns: int, topic: str = "/tf_static") -> Record:
    """A /tf_static of one edge."""
    moved = messages.pose(T_parent_child)
    place = messages.message("geometry_msgs/Vector3", x=moved.position.x, y=moved.position.y, z=moved.position.z)
    transform = messages.message("geometry_msgs/Transform", translation=place, rotation=moved.orientation)
    head = messages.header(stamp_ns, parent)
    one = messages.message("geometry_msgs/TransformStamped", header=head, child_frame_id=child, transform=transform)
    return Record.of(topic, messages.message("tf2_msgs/TFMessage", transforms=[one]), stamp_ns)


def uncalibrated(stamp_ns: int) -> Record:
    """A camera_info as drivers send it until somebody has calibrated the camera."""
    info = messages.camera_info(CAMERA, stamp_ns, "camera")
    info.k[:], info.p[:] = 0, 0
    return Record.of("/camera_info", info, stamp_ns)


def lost(record: Record, value: float = 0.0) -> Record:
    """The record of a pose as a motion capture says it while it sees nothing: every number is ``value``."""
    made = deepcopy(record.message)
    pose = made.pose.pose if hasattr(made.pose, "pose") else made.pose
    for numbers, names in ((pose.position, "xyz"), (pose.orientation, "xyzw")):
        for name in names:
            setattr(numbers, name, value)
    return Record.of(record.topic, made, record.stamp_ns)


def noetic_bag(path: Path, frames: int = 3) -> Path:
    """A rosbag1 with `records`, and with what any robot of ROS 1 says besides: /tf, /rosout, /markers and /arm/0."""
    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf/msg/tfMessage"))
    made = types.types
    header = made["std_msgs/msg/Header"](seq=0, stamp=made["builtin_interfaces/msg/Time"](1, 0), frame_id="map")
    fields = {"level": 2, "name": "n", "msg": "m", "file": "f", "function": "f", "line": 1, "topics": []}
    others = {
        "/tf": made["tf/msg/tfMessage"](transforms=[]),
        "/rosout": made["rosgraph_msgs/msg/Log"](header=header, **fields),
        "/arm/0": made["std_msgs/msg/String"](data="a name that ROS 2 does not allow"),
        "/markers": made["visualization_msgs/msg/MarkerArray"](markers=[]),
    }
    with Rosbag1Writer(path) as writer:
        open_topics: dict[str, Any] = {}
        said = [(record.topic, _old(record.message, types), record.stamp_ns) for record in records(frames)]
        for topic, message, stamp_ns in [*((topic, message, 10**9) for topic, message in others.items()), *said]:
            kind = message.__msgtype__
            if topic not in open_topics:
                open_topics[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(open_topics[topic], stamp_ns, types.serialize_ros1(message, kind))
    return path


def robot_bag(path: Path, frames: int = 3) -> Path:
    """A rosbag2 with `records`, and with a topic /meta of a type that nobody has installed."""
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg("float64 exposure", "acme_msgs/msg/Meta"))
    meta = types.types["acme_msgs/msg/Meta"](exposure=1.0)
    with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/meta", "acme_msgs/msg/Meta", typestore=types)
        writer.write(connection, 10**9, types.serialize_cdr(meta, "acme_msgs/msg/Meta"))
        open_topics: dict[str, Any] = {}
        for record in records(frames):
            if record.topic not in open_topics:
                open_topics[record.topic] = writer.add_connection(record.topic, record.msgtype, typestore=types)
            writer.write(open_topics[record.topic], record.stamp_ns, record.cdr)
    return path


def humble_bag(path: Path, plugin: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """A rosbag2 of ROS 2 Humble: /range is of a type that has fewer fields there, /chatter and /nothing are not."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    made = types.types
    header = made["std_msgs/msg/Header"](stamp=made["builtin_interfaces/msg/Time"](1, 0), frame_id="sonar")
    fields = {"radiation_type": 0, "field_of_view": 0.5, "min_range": 0.1, "max_range": 4.0, "range": 1.5}
    said = {
        "/range": made["sensor_msgs/msg/Range"](header=header, **fields),
        "/chatter": made["std_msgs/msg/String"](data="hello"),
        "/nothing": made["std_msgs/msg/Empty"](),
    }
    with Rosbag2Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic, message in said.items():
            connection = writer.add_connection(topic, message.__msgtype__, typestore=types)
            writer.write(connection, 10**9, types.serialize_cdr(message, message.__msgtype__))
    return path


def _old(message: Any, types: Typestore) -> Any:
    """A message with the fields that its type has in ROS 1."""
    if not hasattr(message, "__msgtype__"):
        return message
    names = [name for name, _ in types.fielddefs[message.__msgtype__][1]]
    values = {name: _old(getattr(message, name, getattr(message, name.lower(), 0)), types) for name in names}
    return types.types[message.__msgtype__](**values)
