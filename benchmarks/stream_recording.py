# SPDX-License-Identifier: Apache-2.0
"""A recording in memory whose messages can be altered on the way: what the faults of `stream_faults` are made of.

Its topics have the names of a RealSense's driver, whatever recording its pictures come from.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from objreg_tools.recording import Record, Recording
from objreg_tools.recording.record import Topic
from objreg_tools.recording.rosbag import messages

CAMERA, BODY = "camera_color_optical_frame", "base_link"
COLOUR, COLOUR_INFO = "/camera/color/image_raw", "/camera/color/camera_info"
DEPTH, DEPTH_INFO = "/camera/aligned_depth_to_color/image_raw", "/camera/aligned_depth_to_color/camera_info"
ODOM, TF_STATIC, TRUTH = "/odom", "/tf_static", "/ground_truth"
IMAGE_TYPE, INFO_TYPE = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
ODOM_TYPE, POSE_TYPE, TF_TYPE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"

Moment = tuple[int, Callable[[], Any]]  # when it was recorded, ns, and what makes the message


@dataclass(frozen=True)
class Stream:
    """The messages of one topic, in order of time."""

    msgtype: str
    moments: tuple[Moment, ...]

    @classmethod
    def of(cls, msgtype: str, made: Iterable[tuple[int, Any]]) -> Stream:
        """A stream of messages that are there already, each with the time at which it was recorded."""
        return cls(msgtype, tuple((stamp_ns, partial(_as_it_is, message)) for stamp_ns, message in made))

    def altered(self, change: Callable[[Any], Any]) -> Stream:
        """The stream with every message changed when it is read; ``change`` leaves what it gets as it is."""
        return replace(self, moments=tuple((ns, partial(_changed, make, change)) for ns, make in self.moments))


class MemoryRecording(Recording):
    """A recording of ``streams`` by topic. Changing it gives another one and leaves this as it is.

    Messages of one time come in the order of their topics.
    """

    kind = "recording in memory"

    def __init__(self, path: Path, streams: Mapping[str, Stream]) -> None:
        self.path, self.notes = path, []
        self.streams = dict(streams)
        self.topics = {name: Topic(name, s.msgtype, len(s.moments)) for name, s in streams.items() if s.moments}
        order = {name: k for k, name in enumerate(streams)}
        rows = [(ns, order[name], name, make) for name, s in streams.items() for ns, make in s.moments]
        self._rows = sorted(rows, key=lambda row: row[:2])
        self.start_ns, self.end_ns = self._rows[0][0], self._rows[-1][0] + 1

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`."""
        for ns, _, name, make in self._rows:
            wanted = topics is None or name in topics
            if wanted and (start_ns is None or ns >= start_ns) and (end_ns is None or ns < end_ns):
                yield Record.made(name, self.streams[name].msgtype, ns, make)

    def messages(self, topic: str) -> list[Any]:
        """All messages of a topic."""
        return [make() for _, make in self.streams[topic].moments]

    def altered(self, topic: str, change: Callable[[Any], Any]) -> MemoryRecording:
        """With every message of a topic changed."""
        return self.having({topic: self.streams[topic].altered(change)})

    def having(self, streams: Mapping[str, Stream]) -> MemoryRecording:
        """With these streams, in place of those of the same topics."""
        return MemoryRecording(self.path, {**self.streams, **streams})

    def without(self, *topics: str) -> MemoryRecording:
        """With some topics left out."""
        return MemoryRecording(self.path, {name: s for name, s in self.streams.items() if name not in topics})


def restamped(message: Any, shift_ns: int) -> Any:
    """The message with the time in its header moved."""
    stamp = message.header.stamp
    ns = stamp.sec * 10**9 + stamp.nanosec + shift_ns
    return replace(message, header=replace(message.header, stamp=messages.time(ns)))


def in_frame(message: Any, frame_id: str) -> Any:
    """The message with another frame in its header."""
    return replace(message, header=replace(message.header, frame_id=frame_id))


def _as_it_is(message: Any) -> Any:
    return message


def _changed(make: Callable[[], Any], change: Callable[[Any], Any]) -> Any:
    return change(make())
