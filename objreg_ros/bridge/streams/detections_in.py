# SPDX-License-Identifier: Apache-2.0
"""How a node receives the objects in a picture: as our detector's table, as vision_msgs boxes, or as masks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import String

from objreg_ros.bridge.messages import from_msg, headers, to_msg, vision_from_msg
from objreg_ros.bridge.messages.label_table import LabelTable
from objreg_ros.bridge.messages.layout import table
from objreg_ros.bridge.messages.vision_to_msg import Detection2DArray, LabelInfo
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.process.intra_process import Surplus
from objreg_ros.bridge.streams.sync import Drop, Match
from objreg_ros.bridge.streams.synchronised_node import SynchronisedNode
from objreg_ros.data.images import Detections

TABLE, BOXES, MASKS = {"detections_table": PointCloud2}, {"detections_in": Detection2DArray}, {"masks": Image}
SOURCES = {"auto": {**TABLE, **BOXES, **MASKS}, "table": TABLE, "vision_msgs": BOXES, "masks": MASKS}
RECEIVED_S = 1.0  # most that a new name waits until every subscriber has it


class DetectionsIn:
    """Feeds the streams ``detections`` and ``labels`` of a node, and reads what it fed.

    The first topic that sends a valid message is taken. A foreign detector has no table of names: its names get
    numbers as they are met, and the table is published before anything is that needs it.
    """

    def __init__(self, node: SynchronisedNode, source: str) -> None:
        topics = {topic: kind for topic, kind in SOURCES[source].items() if kind is not None}
        if not topics:
            raise ValueError(
                f"detections: expected vision_msgs for {source!r}, got none; install ros-jazzy-vision-msgs, "
                "or give masks or our own table"
            )
        self._node, self._labels = node, LabelTable()
        self._out: Publisher | None = None
        self._shared: Mapping[int, str] = {}  # the table that was received or published last: the next node has it
        self._names: dict[int, str] = {}  # the names of a foreign detector's numbers
        node.listen(String, "labels", self._on_labels, qos.latched())
        if LabelInfo is not None and topics.keys() - TABLE.keys():
            node.listen(LabelInfo, "label_info", self._on_names, qos.latched())
        foreign = {topic: node.sensor() for topic in topics if topic not in TABLE}
        node.listen_to_first("detections", topics, self._decode, self._receive, qos.stage(), foreign)

    # Receive

    def _on_labels(self, message: Any) -> None:
        names = self._node.read_aside("labels", from_msg.labels, message)
        if names is not None:
            self._labels.adopt_table(names)
            self._shared = names
            self._node.feed("labels", 0, self._labels.names)

    def _on_names(self, message: Any) -> None:
        names = self._node.read_aside("label_info", vision_from_msg.label_info, message)
        if names is not None:
            self._names = names

    def _decode(self, topic: str, message: Any) -> object:
        if topic in TABLE:
            return isinstance(message, Detections | Surplus) or table(message)
        return self._foreign(message, (1, 1))

    def _receive(self, topic: str, message: Any) -> None:
        if topic not in TABLE:
            self._node.feed("labels", 0, self._labels.names)  # it needs no table, so nothing waits for one
        surplus = isinstance(message, Surplus) or (topic in TABLE and _is_surplus(message))
        self._node.feed("detections", headers.stamp_ns(message), Drop.SURPLUS if surplus else message)

    # Read

    def read(self, match: Match, size: tuple[int, int], size_of_picture: tuple[int, int]) -> Detections:
        """The boxes and masks of a match; `DroppedError` for a message that has none.

        ``size`` (height, width) is that of the depth image, ``size_of_picture`` that of the foreign boxes' picture.
        """
        message = match["detections"]
        if _is_ours(message):
            return self._node.read("detections", from_msg.detections, message, match["labels"], size)
        return self._node.read("detections", self._foreign, message, size_of_picture)

    def names(self, match: Match, detections: Detections) -> to_msg.Labels:
        """The numbers of all names, those of these boxes among them, which are published before they are needed."""
        if _is_ours(match["detections"]):
            return match["labels"]
        self._labels.include(detections.label)
        names = self._labels.names
        if names != self._shared or self._out is None:  # the next node waits for a table, even an empty one
            self._publish(names)
        return names

    def _foreign(self, message: Any, image_hw: tuple[int, int]) -> Detections:
        return vision_from_msg.detections(message, self._names, image_hw, self._node.most_pixels)

    def _publish(self, names: to_msg.Labels) -> None:
        """Publish the table of names, and wait until it has arrived: the next message needs it."""
        if self._out is None:
            self._out = self._node.create_publisher(String, "labels", qos.latched())
        self._shared = names
        self._out.publish(to_msg.labels(names))
        self._out.wait_for_all_acked(Duration(seconds=RECEIVED_S))


def _is_surplus(message: Any) -> bool:
    return isinstance(message, PointCloud2) and from_msg.is_surplus(message)


def _is_ours(message: Any) -> bool:
    """Whether it is of our detector, whose numbers have names in a table."""
    return isinstance(message, Detections | PointCloud2)
