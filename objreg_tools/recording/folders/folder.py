# SPDX-License-Identifier: Apache-2.0
"""A folder of pictures as a recording: colour, depth, a camera_info for each, and the poses beside them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import is_rigid, pose, rigid, rotation_from_quaternion
from objreg_tools.recording.folders.picture_files import colour_message, depth_message
from objreg_tools.recording.folders.tum_camera import TumCamera
from objreg_tools.recording.record import Record, Recording, Topic
from objreg_tools.recording.rosbag import messages

IMAGE, DEPTH, CAMERA_INFO, GROUND_TRUTH, IMU = "/image", "/depth/image", "/camera_info", "/ground_truth", "/imu"
ODOM = "/odom"
TYPES = {
    CAMERA_INFO: "sensor_msgs/msg/CameraInfo",
    GROUND_TRUTH: "geometry_msgs/msg/PoseStamped",
    ODOM: "nav_msgs/msg/Odometry",
    IMU: "sensor_msgs/msg/Imu",
    IMAGE: "sensor_msgs/msg/Image",
    DEPTH: "sensor_msgs/msg/Image",
}
CAMERA_FRAME, WORLD_FRAME, ODOM_FRAME = "camera", "world", "odom"
T_ODOM_ARKIT = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
NUMBERED = "times are the numbers of frames: each is taken for a second"

Pair = tuple[int, str, int, str]  # colour stamp, colour file, depth stamp, depth file


class FrameFiles(NamedTuple):
    """One record before it is made."""

    stamp_ns: int
    topic: str
    make: Callable[[], Any]


class FolderRecording(Recording):
    """A folder of pictures; its topics are those of the graph. A kind of folder finds the pairs, camera and poses."""

    of_pictures = True

    def __init__(
        self,
        path: Path,
        moments: Iterable[FrameFiles],
        notes: Iterable[str],
        made_of: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.path, self.notes, self.made_of = path, list(notes), made_of
        order = list(TYPES)
        self._sequence = sorted(moments, key=lambda m: (m.stamp_ns, order.index(m.topic)))
        counts = {name: sum(m.topic == name for m in self._sequence) for name in TYPES}
        self.topics = {name: Topic(name, TYPES[name], count) for name, count in counts.items() if count}
        self.start_ns, self.end_ns = self._sequence[0].stamp_ns, self._sequence[-1].stamp_ns + 1

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`. The message of a picture that does not decode is a ValueError."""
        for stamp_ns, topic, make in self._sequence:
            wanted = topics is None or topic in topics
            if wanted and (start_ns is None or stamp_ns >= start_ns) and (end_ns is None or stamp_ns < end_ns):
                yield Record.made(topic, TYPES[topic], stamp_ns, make)


def moments_of_pairs(folder: Path, pairs: Sequence[Pair], camera: TumCamera) -> list[FrameFiles]:
    """Colour, depth and camera_info of each pair; larger colour comes in the size of the camera, which is depth's."""
    return [
        moment
        for colour_ns, colour, depth_ns, depth in pairs
        for moment in (
            info_moment(camera, depth_ns),
            FrameFiles(
                colour_ns, IMAGE, partial(colour_message, folder / colour, colour_ns, CAMERA_FRAME, camera.size)
            ),
            FrameFiles(
                depth_ns, DEPTH, partial(depth_message, folder / depth, depth_ns, CAMERA_FRAME, camera.depth_scale)
            ),
        )
    ]


def made_of_pairs(pairs: Sequence[Pair], camera: TumCamera, camera_file: str) -> dict[str, str]:
    """`Recording.made_of` for what `moments_of_pairs` makes: the folders, the steps of depth, and the camera's file."""
    _, colour, _, depth = pairs[0]
    steps = f"{camera.depth_scale:g} steps in a metre"
    return {IMAGE: _folder_of(colour), DEPTH: f"{_folder_of(depth)}, {steps}", CAMERA_INFO: camera_file}


def _folder_of(picture: str) -> str:
    return f"{Path(picture).parent.as_posix()}/"


def info_moment(camera: TumCamera, stamp_ns: int) -> FrameFiles:
    """The camera_info of a depth picture."""
    make = partial(messages.camera_info, camera.intrinsics, stamp_ns, CAMERA_FRAME, camera.distortion)
    return FrameFiles(stamp_ns, CAMERA_INFO, make)


def true_moment(T_world_camera: Array, stamp_ns: int) -> FrameFiles:
    """A pose (4, 4) of the camera, optical frame, that counts as true."""
    return FrameFiles(stamp_ns, GROUND_TRUTH, partial(messages.pose_stamped, T_world_camera, stamp_ns, WORLD_FRAME))


def odometry_moment(T_world_camera: Array, stamp_ns: int) -> FrameFiles:
    """A pose (4, 4) of the camera, optical frame, in ARKit's world, whose y is up: odometry in a frame with z up."""
    T_odom_camera = rigid(T_ODOM_ARKIT @ T_world_camera)
    make = partial(messages.odometry, T_odom_camera, np.zeros((6, 6)), stamp_ns, ODOM_FRAME, CAMERA_FRAME)
    return FrameFiles(stamp_ns, ODOM, make)


def pose_of_numbers(numbers: Array) -> Array | None:
    """The pose (4, 4) of x y z qx qy qz qw; None where they are none."""
    try:
        T = pose(rotation_from_quaternion(numbers[3:]), numbers[:3])
    except ValueError:
        return None
    return T if is_rigid(T) else None
