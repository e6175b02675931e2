# SPDX-License-Identifier: Apache-2.0
"""The topics on which the registrar publishes what it found.

Those of common_interfaces are always there, those of objreg_msgs where that is installed.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from objreg_ros.bridge.messages import closures_msg, localisation_msg, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.diagnostics import acceptances, refusals
from objreg_ros.data.closures import LoopClosure, Observation, Rejected
from objreg_ros.data.localisation import LocalisationState, State

EVERY_NS = 1_000_000_000  # between two states that are alike, by the stamps of frames


class Announcements:
    """Publishes for ``node``, and counts. Not for two threads at once.

    What names no robot is of the one that the node's namespace is called.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._robot = node, node.get_namespace().strip("/")
        self._constraints = node.create_publisher(Odometry, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
        self._refusals = node.create_publisher(DiagnosticArray, "refusals", qos.stage(qos.REFUSALS))
        self._acceptances = node.create_publisher(DiagnosticArray, "acceptances", qos.stage(qos.REFUSALS))
        self._transforms = node.create_publisher(TransformStamped, "transforms", qos.stage(depth=100))
        self._landmarks = node.create_publisher(PointCloud2, "landmarks", qos.stage(depth=100))
        self._markers = node.create_publisher(MarkerArray, "markers", qos.latched())
        self._whole = _Whole(node) if closures_msg.LoopClosureMsg is not None else None
        self._published = Counter[bool]()  # constraints, by whether others confirmed them
        self._withdrawn = 0
        self._refused, self._last_refusals = Counter[str](), dict[str, str]()  # by reason
        self._last_moved = dict[str, float]()  # m by label

    def closures(self, closures: Sequence[LoopClosure]) -> None:
        """Publish constraints to the mapper and others."""
        self._published.update("agreeing" in closure.evidence for closure in closures)
        for closure in closures:
            self._last_moved = closure.moved or self._last_moved
            self._constraints.publish(to_msg.constraint(closure))
            for transform in to_msg.transforms(closure):
                self._transforms.publish(transform)
            if self._whole is not None:
                self._whole.closures.publish(closures_msg.loop_closure(closure, self._robot))
        if closures:
            name, now = self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg()
            self._acceptances.publish(acceptances(name, now, closures))

    def retractions(self, closures: Sequence[LoopClosure]) -> None:
        """Withdraw closures where objreg_msgs is installed: the other topics know of no retraction."""
        self._withdrawn += len(closures)
        if self._whole is not None:
            for closure in closures:
                self._whole.closures.publish(closures_msg.retraction(closure, self._robot))

    def refusals(self, rejected: Sequence[Rejected]) -> None:
        """Publish the refusals; nothing where there are none."""
        self._refused.update(item.reason.value for item in rejected)
        self._last_refusals.update((item.reason.value, item.detail) for item in rejected)
        if rejected:
            name, now = self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg()
            self._refusals.publish(refusals(name, now, rejected))
        if self._whole is not None:
            for item in rejected:
                self._whole.refusals.publish(closures_msg.refusal(item, self._robot))

    def landmarks(
        self,
        observations: Sequence[Observation],
        stamp_ns: int,
        frame_id: str,
        names: to_msg.Labels,
        session: int | None,
        robot: str = "",
    ) -> None:
        """Publish the objects of a keyframe, in the camera ``frame_id`` at ``stamp_ns``."""
        seen = observations, stamp_ns, frame_id, names
        self._landmarks.publish(to_msg.landmarks(*seen))
        if self._whole is not None:
            self._whole.landmarks.publish(closures_msg.object_landmarks(*seen, session, robot or self._robot))

    def markers(self, scene: MarkerArray) -> None:
        """Show the scene in RViz."""
        self._markers.publish(scene)

    def counts(self) -> dict[str, Any]:
        """Constraints, refusals by reason, the last refusal of each, and what moved last: fields of diagnostics."""
        return {
            "constraints": self._published.total(),
            "confirmed": self._published[True],
            "withdrawn": self._withdrawn,
            "rejected": self._refused,
            "last_rejected": self._last_refusals,
            "last_moved": self._last_moved,
        }


class _Whole:
    """The topics of objreg_msgs, which carry all that is known."""

    def __init__(self, node: Node) -> None:
        kept = qos.latched(qos.KEPT_CONSTRAINTS)
        self.closures = node.create_publisher(closures_msg.LoopClosureMsg, "loop_closures", kept)
        self.refusals = node.create_publisher(closures_msg.Refusal, "closure_refusals", qos.stage(qos.SINGLE_REFUSALS))
        self.landmarks = node.create_publisher(closures_msg.ObjectLandmarks, "object_landmarks", qos.stage(depth=100))


class LocalisationAnnouncements:
    """Publishes `localisation_state` for ``node``; ``ask`` gives the state, None before the first frame."""

    def __init__(self, node: Node, ask: Callable[[], LocalisationState | None]) -> None:
        self._ask, self._lock, self._robot = ask, threading.Lock(), node.get_namespace().strip("/")
        self._frame_id, self._asked_ns = "", -EVERY_NS
        self._published: State | None = None
        self.now: LocalisationState | None = None
        kind = localisation_msg.LocalisationStateMsg
        self._publisher = None if kind is None else node.create_publisher(kind, "localisation_state", qos.latched())

    def passed(self, stamp_ns: int, frame_id: str) -> None:
        """After a frame: look once a second."""
        self._frame_id = frame_id
        if not 0 <= stamp_ns - self._asked_ns < EVERY_NS:
            self.look(stamp_ns)

    def look(self, stamp_ns: int | None = None) -> None:
        """Publish where the state has changed; without a change only where ``stamp_ns`` is given. For two threads."""
        with self._lock:
            self.now = now = self._ask()
            if stamp_ns is not None:
                self._asked_ns = stamp_ns
            if now is None or (stamp_ns is None and now.state == self._published):
                return
            self._published = now.state
            if self._publisher is not None:
                self._publisher.publish(localisation_msg.localisation_state(now, self._frame_id, self._robot))
