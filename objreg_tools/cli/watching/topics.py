# SPDX-License-Identifier: Apache-2.0
"""The topics of a running graph into what is watched."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_tools.cli.watching.listening import careful
from objreg_tools.cli.watching.reports import report_of
from objreg_tools.cli.watching.watched import Sight, Watched

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

RECENT = 12  # pictures and tables of detections that wait for their objects
NEAR_NS = 50_000_000  # depth and colour of one frame


def watch(context: Context, watched: Watched, ros_args: Sequence[str]) -> Node:
    """A node that listens, with the ROS arguments of the user: its namespace, and the topics that are remapped."""
    from rclpy.node import Node

    arguments = ["--ros-args", *ros_args] if ros_args else None
    node = Node("objreg_watch", context=context, cli_args=arguments, start_parameter_services=False)
    _listen_to_results(node, watched)
    _listen_to_pictures(node, _Pictures(watched))
    return node


def _listen_to_results(node: Node, watched: Watched) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry, Path
    from visualization_msgs.msg import MarkerArray

    from objreg_ros.bridge.node import qos

    take = _Results(watched)
    node.create_subscription(DiagnosticArray, "/diagnostics", careful(node, take.counters), qos.stage(depth=100))
    node.create_subscription(DiagnosticArray, "acceptances", careful(node, take.acceptances), qos.stage(qos.REFUSALS))
    node.create_subscription(DiagnosticArray, "refusals", careful(node, take.refusals), qos.stage(qos.REFUSALS))
    node.create_subscription(MarkerArray, "markers", careful(node, take.markers), qos.latched())
    node.create_subscription(Odometry, "odom", careful(node, take.odometry), qos.sensor(False, 100))
    node.create_subscription(Path, "path", careful(node, take.path), qos.latched())


def _listen_to_pictures(node: Node, take: _Pictures) -> None:
    from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
    from std_msgs.msg import String

    from objreg_ros.bridge.node import qos

    node.create_subscription(String, "labels", careful(node, take.labels), qos.latched())
    node.create_subscription(Image, "image", careful(node, take.image), qos.sensor(False, 2))
    node.create_subscription(CompressedImage, "image/compressed", careful(node, take.image), qos.sensor(False, 2))
    node.create_subscription(CameraInfo, "camera_info", careful(node, take.camera), qos.sensor(False, 2))
    node.create_subscription(PointCloud2, "detections_table", careful(node, take.detections), qos.stage())
    node.create_subscription(PointCloud2, "objects", careful(node, take.objects), qos.stage())


class _Results:
    """What the nodes say of themselves, and what the registrar found."""

    def __init__(self, watched: Watched) -> None:
        self._watched = watched

    def counters(self, message: Any) -> None:
        for reported in filter(None, map(report_of, message.status)):
            self._watched.report(*reported)

    def acceptances(self, message: Any) -> None:
        from objreg_ros.bridge.node.diagnostics import accepted_of

        for stamps_ns, known in map(accepted_of, message.status):
            self._watched.accept(stamps_ns, known["labels"], known["evidence"])

    def refusals(self, message: Any) -> None:
        from objreg_ros.bridge.node.diagnostics import refusal_of

        for refused in map(refusal_of, message.status):
            self._watched.refuse((refused.from_ns, refused.to_ns), refused.reason.value, refused.detail)

    def odometry(self, message: Any) -> None:
        self._watched.move(_xyz(message.pose.pose.position))

    def path(self, message: Any) -> None:
        self._watched.correct([_xyz(posed.pose.position) for posed in message.poses])

    def markers(self, message: Any) -> None:
        edges: Mapping[str, list[Any]] = {"accepted": [], "rejected": []}
        objects = []
        for marker in message.markers:
            if marker.ns in edges:
                edges[marker.ns].extend(map(_xyz, marker.points))
            elif marker.ns == "names":
                objects.append((marker.text, _xyz(marker.pose.position)))
        self._watched.place(edges, objects)


class _Pictures:
    """Brings pictures, detections and objects of one time together."""

    def __init__(self, watched: Watched) -> None:
        self._watched = watched
        self._images: deque[tuple[int, Any]] = deque(maxlen=RECENT)
        self._tables: deque[tuple[int, Any]] = deque(maxlen=RECENT)
        self._names: Mapping[int, str] = {}
        self._camera: Any = None

    def labels(self, message: Any) -> None:
        self._names = from_msg.labels(message)

    def image(self, message: Any) -> None:
        self._images.append((headers.stamp_ns(message), message))

    def camera(self, message: Any) -> None:
        self._camera = message

    def detections(self, message: Any) -> None:
        if not from_msg.is_surplus(message):
            self._tables.append((headers.stamp_ns(message), message))

    def objects(self, message: Any) -> None:
        """The objects of a frame came last: its picture, if that is still there, is the one that is shown."""
        stamp_ns = headers.stamp_ns(message)
        table, image = _nearest(self._tables, stamp_ns), _nearest(self._images, stamp_ns)
        if table is None or image is None:
            return
        rgb = from_msg.image(image).rgb
        found = from_msg.detections(table, self._names, rgb.shape[:2])
        objects, _ = from_msg.objects(message, self._names)
        self._watched.see(Sight(rgb, found, objects, self._intrinsics(rgb.shape[:2])))

    def _intrinsics(self, hw: tuple[int, int]) -> Any:
        """The camera of a picture of this size; None where it is another's, or not calibrated."""
        if self._camera is None or not camera_from_msg.is_calibrated(self._camera):
            return None
        known = camera_from_msg.intrinsics(self._camera)
        return known if (known.height, known.width) == tuple(hw) else None


def _nearest(recent: Sequence[tuple[int, Any]], stamp_ns: int) -> Any:
    """What has the nearest stamp, None if none is within `NEAR_NS`."""
    if not recent:
        return None
    at_ns, message = min(recent, key=lambda item: abs(item[0] - stamp_ns))
    return message if abs(at_ns - stamp_ns) <= NEAR_NS else None


def _xyz(point: Any) -> tuple[float, float, float]:
    xyz = np.array([point.x, point.y, point.z], float)
    if not np.isfinite(xyz).all():
        raise ValueError(f"position: expected finite numbers, got {xyz.tolist()}")
    return float(xyz[0]), float(xyz[1]), float(xyz[2])
