# SPDX-License-Identifier: Apache-2.0
"""The door of the mapper: ``odom`` and closures in; ``path`` and ``correction`` (map → odom, also as TF) out."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry as OdometryMsg
from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge import from_msg, qos
from objreg_ros.bridge.closures_in import ClosuresIn
from objreg_ros.bridge.door import Door
from objreg_ros.bridge.indoors import Indoors
from objreg_ros.bridge.map_announcements import MapAnnouncements
from objreg_ros.bridge.params import ManagedParams
from objreg_ros.bridge.spin import run
from objreg_ros.bridge.transforms import hear_mount
from objreg_ros.data import JUMP_NS, LoopClosure, Moments, Odometry
from objreg_ros.mapper import saved
from objreg_ros.mapper.adapters.g2o import graph_text
from objreg_ros.mapper.incremental import load
from objreg_ros.mapper.params import MapperNodeParams, MapperParams
from objreg_ros.mapper.pose_graph import ImplausibleError, PoseGraph, Summary
from objreg_ros.mapper.restart import Anew, Restart
from objreg_ros.mapper.solver import Problem, Solution

MOST_WAITING = qos.KEPT_CONSTRAINTS  # closures without odometry yet; the oldest go when there are more
PACE = 20.0  # a path of many keyframes takes long to write: one in so many times as long
LOOK_S = 0.1  # between two looks at whether the path is due


class MapperNode(Door):
    """Keeps the pose graph, solves it whenever a closure came in. The books count closures.

    The worker solves a snapshot, so that odometry never waits; ``_graph_lock`` guards what both threads touch.
    """

    def __init__(self, indoors: Indoors | None = None) -> None:
        super().__init__("mapper", MapperParams, MapperNodeParams, ManagedParams, indoors=indoors)

    def open(self) -> None:
        """Begin a map or go on with one, publish and listen."""
        load()
        self._inputs = self.settings.of(MapperNodeParams)
        self._graph_lock = threading.Lock()
        self._waiting: list[LoopClosure] = []
        self._enabled, self._odom_frame = True, "odom"
        self._odometry_count = self._passed_over_count = self._withdrawn_count = 0
        self._ended_ns = 0  # the last moment of the run of the clock before this one
        self._riding: list[int] = []  # moments of jobs that the next solution settles too
        self._path_due_s, self._has_news = 0.0, False
        self._mount = hear_mount(self, self._inputs.mounting)
        self._newest: Odometry | None = None
        self._restart = self._watch_odometry()
        self._begin(self._resumed())
        self._out = MapAnnouncements(self, self._inputs.map_frame)
        self._serve()
        self.listen(OdometryMsg, "odom", self._hear_odometry, self.sensor(qos.ODOMETRY), watched="odom")
        self._closures = ClosuresIn(self, self._inputs.input, self._take, self._learn, self._withdraw)
        self._closures.know(tie.closure for tie in self._graph.closure_ties if tie.closure is not None)
        self.expect("odom", "odom")
        self.create_timer(LOOK_S, self._publish_path, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _serve(self) -> None:
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(Trigger, "~/save", self._save)
        self.create_service(SetBool, "~/enable", self._enable)

    def _resumed(self) -> PoseGraph | None:
        """The map of another day, solved; None where none is asked for. ValueError, OSError where it cannot be read."""
        if not self._inputs.resume:
            return None
        return saved.load(_saved_path(_absolute(self._inputs.graph_path)), self.settings.of(MapperParams))

    def _begin(self, graph: PoseGraph | None = None) -> None:
        self._graph = graph or PoseGraph(self.settings.of(MapperParams))
        self._summary = Summary() if graph is None else graph.optimise()

    def _start_anew(self, reason: str) -> None:
        """An empty map; the closures that wait are about moments of the old one, and are dropped."""
        with self._graph_lock:
            self._begin()
        self._closures.forget_all()
        waiting, self._waiting = self._waiting, []
        for closure in waiting:
            self.drop(closure.to_ns, reason)

    def adopt(self) -> None:
        """Live parameters hold from the next odometry, closure, solution and save on."""
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
            self._has_news = self._graph.add_odometry(odometry) or self._has_news
        self._publish_correction(odometry.stamp_ns, self._inputs.publish_tf)
        self._tie_what_waits()

    def _begin_elsewhere(self, anew: Anew, stamp_ns: int) -> None:
        """Time jumped back (a looped bag, a simulation begun anew), or odometry was started again elsewhere.

        Where that is on the map only closures can tell. Where they do not name their sessions, those of a clock that
        runs again would be of both runs: that is a new map.
        """
        if anew is Anew.TIME:
            self._ended_ns = self._graph.odometry.stamps_ns[-1]
            back_s = 1e-9 * (self._ended_ns - stamp_ns)
            told = "a new map" if not self._graph.sessions[-1].names else "another session of the map"
            self.get_logger().warning(f"time jumped back by {back_s:.3f} s: {told}")
            if not self._graph.sessions[-1].names:
                self._start_anew(anew.value)
                return
        else:
            self.throttled.warn(
                "new_session",
                "odometry leapt faster than max_speed, or to its origin: where it is on the map is not known, and no "
                "correction is published, until constraints tie it there; ~/reset begins a new map",
            )
        with self._graph_lock:
            self._graph.begin_session()

    # Closures

    def _take(self, closure: LoopClosure) -> None:
        if not self._enabled:
            self._leave(closure, "disabled")
        elif self.let_in(closure.to_ns):
            self._waiting.append(closure)
            self._tie_what_waits()

    def _leave(self, closure: LoopClosure, reason: str, words: str = "") -> None:
        """Drop a closure; told again, it is a new one."""
        self._closures.forget(closure)
        self.drop(closure.to_ns, reason, words)

    def _learn(self, closure: LoopClosure) -> None:
        """A closure that is known names its sessions."""
        with self._graph_lock:
            self._graph.learn_sessions(closure)

    def _withdraw(self, moments: Moments) -> None:
        for closure in [closure for closure in self._waiting if closure.moments == moments]:
            self._waiting.remove(closure)
            self.drop(closure.to_ns, "retracted")
        with self._graph_lock:
            count = self._graph.withdraw(lambda closure: closure.moments == moments)
        self._withdrawn_count += count
        if count:
            self.worker.put((moments[3], None))

    def _tie_what_waits(self) -> None:
        """Odometry and closures come in any order: a closure waits until odometry covers both its moments."""
        waiting, self._waiting = self._waiting, []
        for closure in waiting:
            try:
                self._tie(closure)
            except ImplausibleError as error:
                self._leave(closure, "implausible", f"{_named(closure)}: {error}")
            except ValueError as error:
                self._leave(closure, "two_clocks", str(error))
        while len(self._waiting) > MOST_WAITING:
            self._leave(self._waiting.pop(0), "queue_full", "no odometry covers the moments of the constraint")

    def _tie(self, closure: LoopClosure) -> None:
        """Into the graph, or back to what waits; ValueError if it is implausible or not of one run of the clock."""
        words = [] if self._newest is None else [self._newest]
        T_body_camera = self._mount.T_body_camera(words, closure.to_frame_id)
        with self._graph_lock:
            tied = self._graph.add_closure(closure, T_body_camera)
        if tied:
            self.worker.put((closure.to_ns, closure))
        elif self._graph.in_gap(closure):
            self._leave(closure, "odometry_gap", "no odometry came around a moment of the constraint")
        elif self._graph.is_before_odometry(closure):
            self._leave(closure, "before_odometry", "odometry begins after the first moment of the constraint")
        elif self._is_of_old_run(closure):
            self._leave(closure, "time_jump", "it was found before time jumped back, and came after that")
        else:
            self._waiting.append(closure)

    def _is_of_old_run(self, closure: LoopClosure) -> bool:
        """Whether a closure ends in what was before time jumped back: the registrar searches for a while.

        It speaks of what was, so one of this run does not end long after the newest odometry.
        """
        known = self._graph.odometry.stamps_ns
        return bool(known) and known[-1] + JUMP_NS < closure.to_ns <= self._ended_ns

    def _overtaken(self, job: tuple[int, LoopClosure | None]) -> None:
        if job[1] is not None:
            with self._graph_lock:
                self._riding.append(job[0])  # the newer job solves the graph with this closure in it

    def compute(self, stamp_ns: int, payload: LoopClosure | None) -> bool:
        """Solve the graph as it is now, and settle every closure that came until now."""
        with self._graph_lock:
            graph, problem, riding = self._graph, self._graph.problem(), len(self._riding)
        with self.ledger.timed("optimise"):
            solution = problem.solve() if payload is not None else self._without_withdrawn(problem)
        if solution is None:
            return False
        with self._graph_lock:
            settled, self._riding = self._riding[:riding], self._riding[riding:]
            if graph is self._graph:
                self._summary, self._has_news = graph.adopt(problem, solution), True
            summary = self._summary
        for stamp in settled:
            self.conclude(stamp, lambda: True)
        # The topic alone: TF is sent with odometry only, for its time must not go back.
        self._publish_correction(stamp_ns, by_tf=False)
        self._out.pruned(summary.pruned, summary.residuals)
        return payload is not None

    def _without_withdrawn(self, problem: Problem) -> Solution | None:
        """A solution that no closure waits for, so that no drop tells of what goes wrong; None then."""
        try:
            return problem.solve()
        except (RuntimeError, ValueError) as error:
            self.throttled.warn("retraction", f"the map is not solved without what was withdrawn: {error}")
            return None

    # Publish

    def _publish_path(self) -> None:
        """The path and the graph, where something is new and writing the last ones is not long enough ago."""
        if not self.is_active or not self._has_news or self._newest is None or time.monotonic() < self._path_due_s:
            return
        begun, stamp_ns = time.monotonic(), self._newest.stamp_ns
        with self._graph_lock:
            self._has_news = False
            path = self._graph.path() if self._graph.is_placed else []
            edges = self._graph.edges()
        self._out.path(path, stamp_ns)
        self._out.graph(*edges, stamp_ns)
        self._path_due_s = time.monotonic() + PACE * (time.monotonic() - begun)

    def _publish_correction(self, stamp_ns: int, by_tf: bool) -> None:
        if not self.is_active:  # it follows odometry all the same, so that the map is whole
            return
        with self._graph_lock:
            T_map_odom = self._graph.T_map_odom if self._graph.is_placed else None
        if T_map_odom is not None:
            self._out.correction(T_map_odom, stamp_ns, self._odom_frame, by_tf)

    def extra_diagnostics(self) -> Mapping[str, object]:
        """What the last solution believed."""
        return {
            "odometry": self._odometry_count,
            "odometry passed over": self._passed_over_count,
            "sessions": len(self._graph.sessions),
            "placed in the map": self._graph.is_placed,
            "keyframes": len(self._graph.keyframes),
            "constraints kept": len(self._summary.kept),
            "constraints pruned": len(self._summary.pruned),
            "constraints retracted": self._withdrawn_count,
            "constraints without odometry": len(self._waiting),
        }

    # Services

    def _reset(self, _: Any, response: Any) -> Any:
        self._restart = self._watch_odometry()
        self._start_anew("reset")
        response.success, response.message = True, "started a new map"
        return response

    def _save(self, _: Any, response: Any) -> Any:
        try:
            path = _absolute(self._inputs.graph_path)
            with self._graph_lock:
                poses, edges = self._graph.flat()
                arrays = saved.packed(self._graph)
            path.write_text(graph_text(poses, edges), encoding="ascii")
            saved.save(arrays, _saved_path(path))
        except (OSError, RuntimeError) as error:  # the latter of a home that there is not
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, f"{path} and {_saved_path(path).name}"
        return response

    def _enable(self, request: Any, response: Any) -> Any:
        self._enabled = request.data
        response.success, response.message = True, "enabled" if request.data else "constraints are dropped as disabled"
        return response


def _absolute(graph_path: str) -> Path:
    return Path(graph_path).expanduser().absolute()


def _saved_path(graph_path: Path) -> Path:
    """What `resume` reads, beside the g2o text."""
    return graph_path.with_name(f"{graph_path.stem if graph_path.suffix != '.npz' else graph_path.name}.npz")


def _named(closure: LoopClosure) -> str:
    return f"the constraint from {closure.from_ns} to {closure.to_ns} ns"


def main() -> int:
    """The executable ``mapper``."""
    return run(MapperNode)


if __name__ == "__main__":
    sys.exit(main())
