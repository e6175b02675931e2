# SPDX-License-Identifier: Apache-2.0
"""A node that listens to the whole graph: what came out, the counters of every node, the frame with most objects."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.diagnostics import REJECTED, accepted_of, balance_of, refusal_of
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import Detections, Intrinsics

RECENT = 100  # detections that wait for their objects, objects for their camera, and cameras for theirs

Outline = Callable[[Array, Intrinsics], str]
"""What is kept of the points (M, 3) m of an object in the picture of a camera."""


@dataclass(frozen=True, slots=True)
class LastDetections:
    """One frame as the graph saw it."""

    detections: Detections
    objects: tuple[ObjectCloud, ...]


class Collector(Node):
    """Collects while `spin_until` runs; glimpses have an ``outline`` of each object where that is given."""

    def __init__(self, context: Context, outline: Outline | None = None) -> None:
        super().__init__("collector", context=context)
        self.counters: dict[str, Balance] = {}
        self.rejected: dict[str, int] = {}
        self._constraints: list[LoopClosure] = []
        self._accepted: dict[tuple[int, int], dict[str, Any]] = {}  # stamps of a constraint → fields it does not carry
        self.refusals: list[Rejected] = []
        self.sight: LastDetections | None = None
        self.glimpses: dict[int, dict[str, Any]] = {}  # stamp → labels detected, middles and outlines of objects
        self._names: Mapping[int, str] = {}
        self._outline = outline
        self._waiting: dict[int, Sequence[ObjectCloud]] = {}  # stamp → objects whose camera has not come yet
        self._cameras: dict[int, Intrinsics] = {}  # stamp → camera whose objects have not come yet
        self._recent: deque[Detections] = deque(maxlen=RECENT)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)
        self._listen()

    def _listen(self) -> None:
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_counters, qos.stage(depth=100))
        self.create_subscription(DiagnosticArray, "refusals", self._on_refusals, qos.stage(depth=qos.REFUSALS))
        self.create_subscription(DiagnosticArray, "acceptances", self._on_acceptances, qos.stage(depth=qos.REFUSALS))
        self.create_subscription(Odometry, "constraints", self._on_constraint, qos.latched(qos.KEPT_CONSTRAINTS))
        self.create_subscription(String, "labels", self._on_labels, qos.latched())
        self.create_subscription(PointCloud2, "detections_table", self._on_detections, qos.stage())
        self.create_subscription(PointCloud2, "objects", self._on_objects, qos.stage())
        if self._outline is not None:
            self.create_subscription(CameraInfo, "view/camera_info", self._on_camera, qos.stage())

    @property
    def closures(self) -> list[LoopClosure]:
        """The constraints in the order in which they came, with the objects and the numbers behind them."""
        return [replace(closure, **self._accepted.get((closure.from_ns, closure.to_ns), {}))
                for closure in self._constraints]  # fmt: skip

    def spin_until(self, true: Callable[[], bool], seconds: float) -> bool:
        """Let messages come in until something is true or the time is over; whether it became true."""
        deadline = time.monotonic() + seconds
        while not true() and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)
        return true()

    def call(self, service: str, seconds: float) -> str:
        """Call a Trigger service; its message, empty if it did not answer in time."""
        client = self.create_client(Trigger, service)
        if not self.spin_until(client.service_is_ready, seconds):
            return ""
        future = client.call_async(Trigger.Request())
        return str(future.result().message) if self.spin_until(future.done, seconds) else ""

    def close(self) -> None:
        """End the node."""
        self.destroy_node()
        self._executor.shutdown()  # last, as in `player`

    def _on_counters(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id == "objreg_ros":
                self.counters[status.name.removesuffix(": frames")] = balance_of(status)
                refused = {v.key: int(v.value) for v in status.values if v.key.startswith(REJECTED)}
                self.rejected.update({key.removeprefix(REJECTED): count for key, count in refused.items()})

    def _on_refusals(self, message: DiagnosticArray) -> None:
        self.refusals += map(refusal_of, message.status)

    def _on_acceptances(self, message: DiagnosticArray) -> None:
        self._accepted.update(map(accepted_of, message.status))

    def _on_constraint(self, message: Any) -> None:
        self._constraints.append(from_msg.loop_closure(message))

    def _on_labels(self, message: Any) -> None:
        self._names = from_msg.labels(message)

    def _on_detections(self, message: Any) -> None:
        if message.width:
            detections = from_msg.detections(message, self._names)
            self._recent.append(detections)
            self._glimpse(detections.stamp_ns)["labels"] = list(detections.label)

    def _on_objects(self, message: Any) -> None:
        """Keep the frame with the most objects, and of those the latest."""
        stamp_ns = headers.stamp_ns(message)
        objects, _ = from_msg.objects(message, self._names)
        middles = [[item.label, np.median(item.xyz, axis=0).astype(float).round(4).tolist()] for item in objects]
        self._glimpse(stamp_ns)["objects"] = middles
        self._glimpse(stamp_ns).pop("outlines", None)  # of an earlier frame of this stamp, where a bag is looped
        if self._outline is not None:
            _keep(self._waiting, stamp_ns, objects)
            self._draw(stamp_ns)
        if not self._recent:
            return
        if self.sight is None or len(objects) >= len(self.sight.objects):
            seen = min(self._recent, key=lambda detections: abs(detections.stamp_ns - stamp_ns))
            self.sight = LastDetections(seen, objects)

    def _on_camera(self, message: Any) -> None:
        stamp_ns = headers.stamp_ns(message)
        _keep(self._cameras, stamp_ns, camera_from_msg.intrinsics(message))
        self._draw(stamp_ns)

    def _draw(self, stamp_ns: int) -> None:
        """The outlines of a frame, once its objects and its camera are there: they come in any order."""
        if self._outline is None or stamp_ns not in self._waiting or stamp_ns not in self._cameras:
            return
        objects, camera = self._waiting.pop(stamp_ns), self._cameras.pop(stamp_ns)
        self._glimpse(stamp_ns)["outlines"] = [self._outline(item.xyz, camera) for item in objects]

    def _glimpse(self, stamp_ns: int) -> dict[str, Any]:
        return self.glimpses.setdefault(stamp_ns, {"stamp_ns": stamp_ns, "labels": [], "objects": []})


def _keep(items: dict[int, Any], stamp_ns: int, item: Any) -> None:
    """Keep an item by its stamp, and the `RECENT` last ones only."""
    items[stamp_ns] = item
    if len(items) > RECENT:
        del items[next(iter(items))]
