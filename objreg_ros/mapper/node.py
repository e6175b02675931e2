# SPDX-License-Identifier: Apache-2.0
"""The door of the mapper: ``odom`` and ``constraints`` in; ``path`` and ``correction`` (map → odom, also as TF) out."""

from __future__ import annotations

import sys
import threading
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry as OdometryMsg
from nav_msgs.msg import Path as PathMsg
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge import from_msg, qos, to_msg
from objreg_ros.bridge.door import Door, DroppedError
from objreg_ros.bridge.indoors import Indoors
from objreg_ros.bridge.params import ManagedParams
from objreg_ros.bridge.spin import run
from objreg_ros.bridge.transforms import hear_mount
from objreg_ros.data import JUMP_NS, LoopClosure, Odometry
from objreg_ros.mapper.adapters.g2o import graph_text
from objreg_ros.mapper.optimisation import load
from objreg_ros.mapper.params import MapperNodeParams, MapperParams
from objreg_ros.mapper.pose_graph import ImplausibleError, PoseGraph, Summary
from objreg_ros.mapper.restart import Anew, Restart

try:
    from tf2_ros import TransformBroadcaster
except ImportError:  # optional: the topic carries the same
    TransformBroadcaster = None

MOST_WAITING = qos.KEPT_CONSTRAINTS  # constraints without odometry yet; the oldest go when there are more


class MapperNode(Door):
    """Keeps the pose graph, solves it whenever a constraint came in. The books count constraints.

    The worker solves a snapshot, so that odometry never waits; ``_graph_lock`` guards what both threads touch.
    """

    def __init__(self, indoors: Indoors | None = None) -> None:
        super().__init__("mapper", MapperParams, MapperNodeParams, ManagedParams, indoors=indoors)

    def open(self) -> None:
        """Begin a map, publish and listen."""
        self._inputs = self.settings.of(MapperNodeParams)
        self._graph_lock = threading.Lock()
        self._waiting: list[LoopClosure] = []
        self._enabled, self._odom_frame = True, "odom"
        self._odometry_count = self._passed_over_count = 0
        self._ended_ns = 0  # the last moment of the run of the clock before this one
        self._riding: list[tuple[int, LoopClosure | None]] = []  # jobs that the next solution settles too
        self._mount = hear_mount(self, self._inputs.mounting)
        self._newest: Odometry | None = None
        self._restart = self._watch_odometry()
        self._begin()
        self._path = self.create_publisher(PathMsg, "path", qos.latched())
        self._correction = self.create_publisher(TransformStamped, "correction", qos.latched())
        broadcasts = self._inputs.publish_tf and TransformBroadcaster is not None
        self._broadcaster = TransformBroadcaster(self) if broadcasts else None
        self._serve()
        self.listen(OdometryMsg, "odom", self._hear_odometry, self.sensor(qos.ODOMETRY), watched="odom")
        self.listen(OdometryMsg, "constraints", self._hear_constraint, qos.latched(qos.KEPT_CONSTRAINTS))
        self.expect("odom", "odom")
        load()  # what comes meanwhile waits in the queues of DDS

    def _serve(self) -> None:
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(Trigger, "~/save", self._save)
        self.create_service(SetBool, "~/enable", self._enable)

    def _begin(self) -> None:
        self._graph = PoseGraph(self.settings.of(MapperParams))
        self._summary = Summary((), ())

    def _start_anew(self, reason: str) -> None:
        """An empty map; the constraints that wait are about moments of the old one, and are dropped."""
        with self._graph_lock:
            self._begin()
        waiting, self._waiting = self._waiting, []
        for closure in waiting:
            self.drop(closure.to_ns, reason)

    def adopt(self) -> None:
        """Live parameters hold from the next odometry, constraint, solution and save on."""
        self._inputs = self.settings.of(MapperNodeParams)
        with self._graph_lock:
            self._graph.params = self.settings.of(MapperParams)

    # Odometry

    def _hear_odometry(self, message: Any) -> None:
        odometry = self.read_aside("odom", from_msg.odometry, message)
        if odometry is None:
            return
        course = self._restart.admit(odometry)
        if course.anew is not None:
            self._begin_elsewhere(course.anew, course.poses[0].stamp_ns)
        for admitted in course.poses:
            self._follow(admitted)

    def _watch_odometry(self) -> Restart:
        return Restart(self.settings.of(MapperParams).max_speed, self._pass_over)

    def _pass_over(self, odometry: Odometry) -> None:
        """Count a pose that was wrong; say so of one that leapt, and not of one that came again or late."""
        self._passed_over_count += 1
        known = self._graph.odometry.stamps_ns
        if known and odometry.stamp_ns > known[-1]:
            self.throttled.warn(
                "odometry_leap",
                "odometry passed over: it leapt faster than max_speed, or to its origin, and came back; "
                "is there more than one publisher on odom?",
            )

    def _follow(self, odometry: Odometry) -> None:
        self._odometry_count += 1
        self._odom_frame, self._newest = odometry.frame_id, odometry
        with self._graph_lock:
            new_keyframe = self._graph.add_odometry(odometry)
        if new_keyframe:
            self._publish_path(odometry.stamp_ns)
        self._publish_correction(odometry.stamp_ns)
        self._tie_what_waits()

    def _begin_elsewhere(self, anew: Anew, stamp_ns: int) -> None:
        """A new map: time jumped back (a looped bag, a simulation begun anew), or odometry was started again elsewhere.

        Nothing says where that is on the map.
        """
        if anew is Anew.TIME:
            self._ended_ns = self._graph.odometry.stamps_ns[-1]
            back_s = 1e-9 * (self._ended_ns - stamp_ns)
            self.get_logger().warning(f"time jumped back by {back_s:.3f} s: a new map")
        else:
            self.throttled.warn("new_map", "odometry leapt faster than max_speed, or to its origin: a new map")
        self._start_anew(anew.value)

    # Constraints

    def _hear_constraint(self, message: Any) -> None:
        closure = self.read_aside("constraints", from_msg.loop_closure, message)
        stamp_ns = from_msg.stamp_ns(message) if closure is None else closure.to_ns
        self.accept(stamp_ns)
        if closure is None:
            self.drop(stamp_ns, "malformed_constraints")
        elif not self._enabled:
            self.drop(stamp_ns, "disabled")
        elif self.let_in(stamp_ns):
            self._waiting.append(closure)
            self._tie_what_waits()

    def _tie_what_waits(self) -> None:
        """Odometry and constraints come in any order: a constraint waits until odometry covers both its moments."""
        waiting, self._waiting = self._waiting, []
        for closure in waiting:
            try:
                self._tie(closure)
            except ImplausibleError as error:
                self.drop(closure.to_ns, "implausible", f"{_named(closure)}: {error}")
            except ValueError as error:
                self.drop(closure.to_ns, "two_clocks", str(error))
        while len(self._waiting) > MOST_WAITING:
            self.drop(self._waiting.pop(0).to_ns, "queue_full", "no odometry covers the moments of the constraint")

    def _tie(self, closure: LoopClosure) -> None:
        """Into the graph, or back to what waits; ValueError if it is implausible or not of one run of the clock."""
        words = [] if self._newest is None else [self._newest]
        T_body_camera = self._mount.T_body_camera(words, closure.to_frame_id)
        with self._graph_lock:
            tied = self._graph.add_closure(closure, T_body_camera)
        if tied:
            self.worker.put((closure.to_ns, closure))
        elif self._graph.in_gap(closure):
            self.drop(closure.to_ns, "odometry_gap", "no odometry came around a moment of the constraint")
        elif self._came_too_early(closure):
            self.drop(closure.to_ns, "before_odometry", "odometry begins after the first moment of the constraint")
        elif self._is_of_old_run(closure):
            self.drop(closure.to_ns, "time_jump", "it was found before time jumped back, and came after that")
        else:
            self._waiting.append(closure)

    def _came_too_early(self, closure: LoopClosure) -> bool:
        known = self._graph.odometry.stamps_ns
        return bool(known) and closure.from_ns < known[0]

    def _is_of_old_run(self, closure: LoopClosure) -> bool:
        """Whether a constraint ends in what was before time jumped back: the registrar searches for a while.

        It speaks of what was, so one of this run does not end long after the newest odometry.
        """
        known = self._graph.odometry.stamps_ns
        return bool(known) and known[-1] + JUMP_NS < closure.to_ns <= self._ended_ns

    def _overtaken(self, job: tuple[int, LoopClosure | None]) -> None:
        with self._graph_lock:
            self._riding.append(job)  # the newer job solves the graph with this constraint in it

    def compute(self, stamp_ns: int, payload: LoopClosure | None) -> bool:
        """Solve the graph as it is now, and settle every constraint that came until now."""
        with self._graph_lock:
            riding, self._riding = self._riding, []
            graph, problem = self._graph, self._graph.problem()
        with self.ledger.timed("optimise"):
            solution = problem.solve()
        unsolvable: tuple[LoopClosure, ...] = ()
        with self._graph_lock:
            if graph is self._graph:
                self._summary = graph.adopt(problem, solution)
                unsolvable = self._summary.unsolvable
        for stamp, closure in riding:
            self.conclude(stamp, partial(_settle, closure, unsolvable))
        self._publish_path(stamp_ns)
        # The topic alone: TF is sent with odometry only, for its time must not go back.
        self._correction.publish(self._correction_message(stamp_ns))
        return _settle(payload, unsolvable)

    # Publish

    def _publish_path(self, stamp_ns: int) -> None:
        if not self.is_active:  # it follows odometry all the same, so that the map is whole
            return
        with self._graph_lock:
            path = self._graph.path()
        self._path.publish(to_msg.path(path, stamp_ns, self._inputs.map_frame))

    def _publish_correction(self, stamp_ns: int) -> None:
        if not self.is_active:
            return
        message = self._correction_message(stamp_ns)
        self._correction.publish(message)
        if self._inputs.publish_tf and TransformBroadcaster is not None:
            self._broadcaster = self._broadcaster or TransformBroadcaster(self)
            self._broadcaster.sendTransform(message)

    def _correction_message(self, stamp_ns: int) -> TransformStamped:
        with self._graph_lock:
            T_map_odom = self._graph.T_map_odom
        return to_msg.transform(T_map_odom, stamp_ns, self._inputs.map_frame, self._odom_frame)

    def extra_diagnostics(self) -> Mapping[str, object]:
        """What the last solution believed."""
        return {
            "odometry": self._odometry_count,
            "odometry passed over": self._passed_over_count,
            "keyframes": len(self._graph.keyframes),
            "constraints kept": len(self._summary.kept),
            "constraints pruned": len(self._summary.pruned),
            "constraints without odometry": len(self._waiting),
        }

    # Services

    def _reset(self, _: Any, response: Any) -> Any:
        self._restart = self._watch_odometry()
        self._start_anew("reset")
        response.success, response.message = True, "started a new map"
        return response

    def _save(self, _: Any, response: Any) -> Any:
        with self._graph_lock:
            poses = [T for _, T in self._graph.path()]
            text = graph_text(poses, [(tie.k1, tie.k2, tie.constraint) for tie in self._graph.ties])
        path = Path(self._inputs.graph_path).expanduser().absolute()
        try:
            path.write_text(text, encoding="ascii")
        except OSError as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, str(path)
        return response

    def _enable(self, request: Any, response: Any) -> Any:
        self._enabled = request.data
        response.success, response.message = True, "enabled" if request.data else "constraints are dropped as disabled"
        return response


def _settle(closure: LoopClosure | None, unsolvable: Sequence[LoopClosure]) -> bool:
    """True; `DroppedError` where the map cannot be solved with the constraint."""
    if any(closure is failed for failed in unsolvable):
        raise DroppedError("unsolvable", f"{_named(closure)}: the map has no solution with it, and goes on without it")
    return True


def _named(closure: LoopClosure | None) -> str:
    return "" if closure is None else f"the constraint from {closure.from_ns} to {closure.to_ns} ns"


def main() -> int:
    """The executable ``mapper``."""
    return run(MapperNode)


if __name__ == "__main__":
    sys.exit(main())
