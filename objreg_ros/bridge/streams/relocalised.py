# SPDX-License-Identifier: Apache-2.0
"""How the registrar publishes the robot's pose in the map of an earlier session: two topics and a service."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.streams.params import RelocalisedParams
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Relocalised
from objreg_ros.geometry import inverse, pose, rotation_from_vector, turned_about

try:
    from objreg_msgs.srv import Relocalise
except ImportError:  # optional: std_srvs asks as well
    Relocalise = None

LONGEST_WAIT_S = 60.0  # of the service
LOOK_S = 0.05  # so often it looks meanwhile
MOST_WAITING = 16  # callers of the service; each has a thread, and further ones get what is known now
PLANE = (0, 1, 5)  # x, y and yaw of a covariance in ROS order

Answer = tuple[Relocalised | None, str]  # where it is, and by what that is known or why it is not


class Whereabouts:
    """Publishes `relocalised`, and `initialpose` where that is wanted, once as soon as ``ask`` knows, and when asked.

    After the answer has become unknown nobody who comes late gets the old one, and the next is published once again.
    """

    def __init__(self, node: NodeBase, ask: Callable[[], Answer]) -> None:
        self._node, self._ask, self._lock = node, ask, threading.RLock()
        self._params = node.settings.of(RelocalisedParams)
        self._T_body_camera: Array | None = None
        self._known, self._waiting = False, 0
        self._publisher = _publisher(node, "relocalised")
        self._initial: Any = _publisher(node, "initialpose") if self._params.initialpose else None
        serve = (Trigger, self._trigger) if Relocalise is None else (Relocalise, self._relocalise)
        node.create_service(serve[0], "~/relocalise", serve[1], callback_group=node.apart)

    def mounted(self, T_body_camera: Array | None) -> None:
        """Where the camera of the newest frame sits on the body (4, 4); None where they are one."""
        self._T_body_camera = T_body_camera

    def look(self) -> None:
        """After a frame, and after a search: publish what has become known. For two threads."""
        with self._lock:
            found, reason = self._ask()
            if found is not None and not self._known:
                self._node.get_logger().info(f"relocalised in the map of session {found.session}: {reason}")
                self._publish(found)
            elif found is None and self._known:
                self._node.destroy_publisher(self._publisher)  # and with it what it keeps for who comes late
                self._publisher = _publisher(self._node, "relocalised")
            self._known = found is not None

    def _publish(self, found: Relocalised) -> PoseWithCovarianceStamped:
        message = with_covariance(*_of_body(found, self._T_body_camera), found.stamp_ns, self._params.map_frame)
        with self._lock:  # a service's thread, too
            self._publisher.publish(message)
        if self._initial is not None:
            self._publish_on_plane(found, message)
        return message

    def _publish_on_plane(self, found: Relocalised, message: PoseWithCovarianceStamped) -> None:
        """On the plane of a level map, for a body whose x axis looks ahead; a camera's frames are neither."""
        if found.by_odometry and self._T_body_camera is not None:
            self._initial.publish(on_plane(message))
            return
        self._node.throttled.remind(
            "initialpose", "expected odometry in both sessions, and to know where the camera sits on a body, got less; "
            "no pose is published: publish odom, and set T_base_camera or have it on /tf_static"
        )  # fmt: skip

    async def _trigger(self, _: Any, response: Any) -> Any:
        found, response.message = self._ask()
        response.success = found is not None
        if found is not None:
            position = self._publish(found).pose.pose.position
            response.message = (
                f"session {found.session} at {position.x:.3f} {position.y:.3f} {position.z:.3f} m: {response.message}"
            )
        return response

    async def _relocalise(self, request: Any, response: Any) -> Any:
        seconds = request.wait_seconds
        if not 0.0 <= seconds <= LONGEST_WAIT_S:
            response.success = False
            response.message = f"wait_seconds: expected 0 to {LONGEST_WAIT_S:g}, got {seconds:g}"
            return response
        found, response.message = await self._awaited(seconds)
        response.success = found is not None
        if found is not None:
            response.pose, response.session = self._publish(found), str(found.session)
        return response

    async def _awaited(self, seconds: float) -> Answer:
        """As `_await`, by a thread of its own; at once for who need not wait, or finds too many waiting."""
        if seconds == 0.0 or self._waiting >= MOST_WAITING:
            return self._ask()
        self._waiting += 1
        try:
            answer: Answer = await self._node.aside(lambda: self._await(seconds))
        finally:
            self._waiting -= 1
        return answer

    def _await(self, seconds: float) -> Answer:
        """The answer as soon as it is known, at most so much later."""
        deadline = time.monotonic() + seconds
        while (answer := self._ask())[0] is None and time.monotonic() < deadline and self._node.context.ok():
            time.sleep(LOOK_S)
        return answer


def _publisher(node: Node, topic: str) -> Any:
    return node.create_publisher(PoseWithCovarianceStamped, topic, qos.latched() if topic == "relocalised" else 1)


def _of_body(found: Relocalised, T_body_camera: Array | None) -> tuple[Array, Array]:
    """The body in the map (4, 4), and the covariance of that (6, 6)."""
    if T_body_camera is None:
        return found.T_map_camera, found.covariance
    T_map_body = found.T_map_camera @ inverse(T_body_camera)
    return T_map_body, turned_about(found.covariance, T_map_body[:3, 3] - found.T_map_camera[:3, 3])


def with_covariance(T: Array, covariance: Array, stamp_ns: int, frame_id: str) -> PoseWithCovarianceStamped:
    """A pose (4, 4) in a frame, with its covariance (6, 6)."""
    message = PoseWithCovarianceStamped(header=to_msg.header(stamp_ns, frame_id))
    message.pose.pose = to_msg.pose(T)
    message.pose.covariance = covariance.ravel()
    return message


def on_plane(message: PoseWithCovarianceStamped) -> PoseWithCovarianceStamped:
    """The same on the plane z = 0 of its frame, whose z is up: x, y and yaw with their covariance, all else 0.

    The yaw is that of the body's x axis. Where that points straight up or down, it is that of the axis y, less 90°.
    """
    at, q = message.pose.pose.position, message.pose.pose.orientation
    forward = 1.0 - 2.0 * (q.y**2 + q.z**2), 2.0 * (q.x * q.y + q.z * q.w)
    left = 2.0 * (q.x * q.y - q.z * q.w), 1.0 - 2.0 * (q.x**2 + q.z**2)
    steep = math.hypot(*forward) < 1e-3
    yaw = math.atan2(-left[0], left[1]) if steep else math.atan2(forward[1], forward[0])
    planar = np.zeros((6, 6))
    planar[np.ix_(PLANE, PLANE)] = np.reshape(message.pose.covariance, (6, 6))[np.ix_(PLANE, PLANE)]
    T = pose(rotation_from_vector(np.array([0.0, 0.0, yaw])), np.array([at.x, at.y, 0.0]))
    flat = PoseWithCovarianceStamped(header=message.header)
    flat.pose.pose, flat.pose.covariance = to_msg.pose(T), planar.ravel()
    return flat
