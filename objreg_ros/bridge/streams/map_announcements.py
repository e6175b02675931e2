# SPDX-License-Identifier: Apache-2.0
"""The topics on which the mapper publishes its map: ``path``, ``correction`` (and TF), ``graph`` and ``pruned``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from objreg_ros.bridge.messages import markers, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.closures import LoopClosure

try:
    from tf2_ros import TransformBroadcaster
except ImportError:  # optional: the topic carries the same
    TransformBroadcaster = None

Array = NDArray[Any]


class MapAnnouncements:
    """Publishes for ``node``, in the frame of the map; each topic in one piece from whatever thread.

    ``path`` and ``correction`` are of one robot each: ``prefixes`` has what stands before their names, by robot.
    """

    def __init__(self, node: Node, map_frame: str, prefixes: Mapping[str, str]) -> None:
        self._node, self._map_frame = node, map_frame
        latched = qos.latched()
        self._paths = {robot: node.create_publisher(Path, f"{at}path", latched) for robot, at in prefixes.items()}
        self._corrections = {
            robot: node.create_publisher(TransformStamped, f"{at}correction", latched) for robot, at in prefixes.items()
        }
        self._graph = node.create_publisher(MarkerArray, "graph", qos.latched())
        self._pruned = node.create_publisher(DiagnosticArray, "pruned", qos.latched())
        self._broadcaster: Any = None

    def path(self, robot: str, poses: Iterable[tuple[int, Array]], stamp_ns: int) -> None:
        """Publish stamp and ``T_map_body`` of a robot's keyframes, as they are known at a time."""
        self._paths[robot].publish(to_msg.path(poses, stamp_ns, self._map_frame))

    def correction(self, robot: str, T_map_odom: Array, stamp_ns: int, odom_frame: str, by_tf: bool) -> None:
        """Publish a robot's odometry frame in the map; with ``by_tf`` on /tf too, where tf2_ros is installed."""
        message = to_msg.transform(T_map_odom, stamp_ns, self._map_frame, odom_frame)
        self._corrections[robot].publish(message)
        if by_tf and TransformBroadcaster is not None:
            self._broadcaster = self._broadcaster or TransformBroadcaster(self._node)
            self._broadcaster.sendTransform(message)

    def graph(self, kept: Array, pruned: Array, residuals: Array, stamp_ns: int) -> None:
        """Show closures between two places each, (m, 2, 3) and (n, 2, 3); residuals of the latter, in deviations."""
        if self._graph.get_subscription_count():
            self._graph.publish(markers.closures(kept, pruned, residuals, stamp_ns, self._map_frame))

    def pruned(self, closures: Sequence[LoopClosure], residuals: Sequence[float]) -> None:
        """Publish all closures that the map now leaves out, and how far each is from it."""
        name, now = self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg()
        status = [_status(name, *row) for row in zip(closures, residuals, strict=True)]
        self._pruned.publish(DiagnosticArray(header=Header(stamp=now), status=status))


def _status(node: str, closure: LoopClosure, residual: float) -> DiagnosticStatus:
    values = {
        "from [ns]": closure.from_ns,
        "to [ns]": closure.to_ns,
        "residual [standard deviations]": f"{residual:.3g}",
        **{key: robot for key, robot in zip(("from robot", "to robot"), closure.robots, strict=True) if robot},
    }
    return DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name=f"{node}: pruned",
        message=f"{residual:.3g} standard deviations from a map that others agree on",
        hardware_id="objreg_ros",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
