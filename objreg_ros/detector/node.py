# SPDX-License-Identifier: Apache-2.0
"""The node of the detector: ``image`` (raw or compressed) in; ``detections_table``, ``detections``, ``labels`` out."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import String

from objreg_ros import share
from objreg_ros.bridge.camera.pace import RateLimit
from objreg_ros.bridge.messages import from_msg, headers, to_msg, vision_to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.process.intra_process import IntraProcessBus, Surplus
from objreg_ros.bridge.streams.frame_order import FrameOrder
from objreg_ros.bridge.streams.sync import Drop
from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams

IMAGES = {"image": Image, "image/compressed": CompressedImage}


class DetectorNode(NodeBase):
    """Detects the objects of the newest image of those that keep the pace; the others are surplus and not decoded.

    A table goes out for every image, empty if it shows no object, and of a kind of its own if it is surplus.
    """

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        super().__init__("detector", DetectorParams, ManagedParams, bus=bus)

    def open(self) -> None:
        """Load the model, publish its labels, and subscribe."""
        params = self.settings.of(DetectorParams)
        self._detector = Detector.of(params, share.model)
        whose = "as set" if params.threshold else "the model's own"
        self.get_logger().info(f"{share.model(params.model).name}, threshold {self._detector.threshold:g} ({whose})")
        self._rate_limit, self._order = RateLimit(params.max_rate), FrameOrder(self._leave_out)
        self._names = dict(enumerate(self._detector.labels))
        self._table = self.offer(PointCloud2, "detections_table", qos.stage())
        array = vision_to_msg.Detection2DArray
        self._array = None if array is None else self.create_publisher(array, "detections", qos.stage())
        self._labels = self.create_publisher(String, "labels", qos.latched())
        self._labels.publish(to_msg.labels(self._names))
        for topic in IMAGES:  # the next node does not decode again what this one has decoded
            self.pass_on(topic)
        self.listen_to_first("image", IMAGES, self._decode, self._receive, self.sensor())

    def apply_parameters(self) -> None:
        """Live parameters hold from the next image on."""
        self._detector.params = self.settings.of(DetectorParams)

    def _decode(self, _: str, message: Any) -> ColourImage:
        return from_msg.image(message, self.most_pixels)

    def _receive(self, _: str, message: Any) -> None:
        stamp_ns = headers.stamp_ns(message)
        self.accept(stamp_ns)
        if not self.let_in(stamp_ns):
            return
        if self._rate_limit.admits(stamp_ns):
            self._order.begin_frame(stamp_ns)
            self.worker.put((stamp_ns, message))
        else:
            self._order.put_off(stamp_ns, message.header.frame_id)

    def _leave_out(self, stamp_ns: int, frame_id: str) -> None:
        """Report a surplus image, after the tables of those before it."""
        surplus = Surplus(stamp_ns, frame_id)
        self._hand_over_picture(surplus)
        self._table.publish(surplus, partial(to_msg.surplus, *surplus))
        self.leave_out(stamp_ns, Drop.SURPLUS.value)

    def conclude(self, stamp_ns: int, work: Callable[[], bool]) -> None:
        """As any node; those behind it have their turn."""
        super().conclude(stamp_ns, work)
        self._order.end_frame(stamp_ns)

    def _overtaken(self, job: tuple[int, Any]) -> None:
        super()._overtaken(job)
        self._order.end_frame(job[0])

    def compute(self, stamp_ns: int, payload: Any) -> bool:
        """One image."""
        image = self.read("image", from_msg.image, payload, self.most_pixels)
        self._hand_over_picture(image)
        with self.accounting.timed("detect"):
            detections = self._detector.detect(image)
        self._table.publish(detections, partial(to_msg.detections_table, detections, self._names))
        if self._array is not None and self._array.get_subscription_count():
            self._array.publish(vision_to_msg.detections(detections))
        return True

    def _hand_over_picture(self, value: ColourImage | Surplus) -> None:
        topic = self.taken("image")
        if topic is not None:
            self.bus.hand_over(self.resolve_topic_name(topic), value)


def main() -> int:
    """The executable ``detector``."""
    return run(DetectorNode)


if __name__ == "__main__":
    sys.exit(main())
