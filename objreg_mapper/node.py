# SPDX-License-Identifier: Apache-2.0
"""The node of the mapper: ``odom`` and closures in; ``path`` and ``correction`` (map → odom, also as TF) out."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from nav_msgs.msg import Odometry as OdometryMsg
from rclpy.clock import Clock, ClockType
from std_srvs.srv import Trigger

from objreg_mapper import saved
from objreg_mapper.diagnostics import MapperDiagnostics
from objreg_mapper.follower import Follower, Followers
from objreg_mapper.formats.g2o import graph_text, times_text
from objreg_mapper.map_files import graph_file, require_ours, write_graph
from objreg_mapper.optimisation.incremental import load
from objreg_mapper.optimisation.problem import Problem, Solution
from objreg_mapper.params import MapperNodeParams, MapperParams
from objreg_mapper.pose_graph import MapSummary, PoseGraph
from objreg_mapper.restart import Anew
from objreg_mapper.waiting import ClosureQueue
from objreg_ros.bridge.camera.transforms import receive_mount
from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.robots import prefixes_of
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.process.intra_process import IntraProcessBus
from objreg_ros.bridge.streams.closures_in import ClosuresIn
from objreg_ros.bridge.streams.map_announcements import MapAnnouncements
from objreg_ros.data.closures import LoopClosure, Moments, Robots, may_be_same
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.plausibility.finding import Finding

PATH_REST = 20.0  # a path of many keyframes takes long to write: one in so many times as long
LOOK_S = 0.1  # between two looks at whether the path is due


class MapperNode(NodeBase):
    """Keeps the pose graph, solves it whenever a closure came in. It counts closures.

    The worker solves a snapshot, so that odometry never waits; ``_graph_lock`` guards what both threads touch.
    """

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        super().__init__("mapper", MapperParams, MapperNodeParams, ManagedParams, bus=bus)

    def open(self) -> None:
        """Begin a map or go on with one, publish and listen."""
        load()
        self._inputs = self.settings.of(MapperNodeParams)
        self._graph_lock, self._save_lock = threading.Lock(), threading.Lock()
        self._graph_file = graph_file(self._inputs.graph_path)
        self._saved_file = saved.beside(self._graph_file)
        require_ours(self._saved_file)
        self._withdrawn_count = 0
        self._riding: list[int] = []  # stamps of jobs that the next solution settles too
        self._path_due_s = 0.0
        self._shared_frames = set[str]()  # of which the log has warned
        self._followers = Followers()
        mount = receive_mount(self, self._inputs.mounting)
        self._waiting = ClosureQueue(self._followers, mount.T_body_camera, qos.KEPT_CONSTRAINTS)
        self._begin(self._resumed())
        prefixes = prefixes_of(self, self._inputs.robots)
        self._out = MapAnnouncements(self, self._inputs.map_frame, prefixes)
        self._serve()
        for robot, prefix in prefixes.items():
            self._follow(robot, f"{prefix}odom")
        self._closures = ClosuresIn(self, self._inputs.input, self._take, self._learn, self._withdraw, prefixes)
        self._closures.know(tie.closure for tie in self._graph.closure_ties if tie.closure is not None)
        self.create_timer(LOOK_S, self._publish_paths, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _serve(self) -> None:
        self.create_service(Trigger, "~/reset", self._reset)
        self.serve_aside("~/save", self._save)
        self.serve_enable("constraints")

    def _resumed(self) -> PoseGraph | None:
        """The map of another day, solved; None where none is asked for. ValueError, OSError where it cannot be read."""
        if not self._inputs.resume:
            return None
        return saved.load(self._saved_file, self.settings.of(MapperParams))

    def _begin(self, graph: PoseGraph | None = None) -> None:
        self._graph = graph or PoseGraph(self.settings.of(MapperParams))
        self._summary = MapSummary() if graph is None else graph.optimise()

    def _start_anew(self, reason: str) -> None:
        """An empty map; the closures that wait are of keyframes of the old one, and are dropped."""
        with self._graph_lock:
            self._begin()
        self._closures.forget_all()
        for closure in self._waiting.take_out():
            self.drop(closure.to_ns, reason)

    def apply_parameters(self) -> None:
        """Live parameters hold from the next odometry, closure and solution on."""
        self._inputs = self.settings.of(MapperNodeParams)
        with self._graph_lock:
            self._graph.params = self.settings.of(MapperParams)

    # Odometry

    def _follow(self, robot: str, topic: str) -> None:
        on_leap = partial(self._log_leap, topic)
        self._followers[robot] = Follower(robot, self.settings.of(MapperParams).max_speed, on_leap)
        receive = partial(self._on_odometry, robot=robot)
        self.listen(OdometryMsg, topic, receive, self.sensor(qos.ODOMETRY), watched=topic)
        self.expect(topic, topic)

    def _on_odometry(self, message: Any, robot: str = "") -> None:
        odometry = self.read_aside("odom", motion_from_msg.odometry, message)
        if odometry is None:
            return
        follower = self._followers[robot]
        admission = follower.admit(odometry)
        if admission.anew is not None:
            self._begin_elsewhere(follower, admission.anew, admission.poses[0].stamp_ns)
        for admitted in admission.poses:
            with self._graph_lock:
                follower.follow_pose(admitted, self._graph)
            self._publish_correction(follower, self._inputs.publish_tf)
            self._tie_what_waits()

    def _log_leap(self, topic: str) -> None:
        self.throttled.warn(
            "odometry_leap",
            "odometry passed over: it leapt faster than max_speed, or to its origin, and came back; "
            f"is there more than one publisher on {topic}?",
        )

    def _begin_elsewhere(self, follower: Follower, anew: Anew, stamp_ns: int) -> None:
        """Time jumped back (a looped bag, a simulation begun anew), or odometry was started again elsewhere.

        Only closures can say where that is on the map. Where they do not name their sessions, those of a clock that
        runs again would be of both runs: that is a new map, unless other robots are in it.
        """
        if anew is Anew.TIME:
            back_s, is_new = follower.jump_back(stamp_ns), follower.is_confusable(self._graph)
            what = "a new map" if is_new else "another session of the map"
            self.get_logger().warning(f"time jumped back by {back_s:.3f} s: {what}")
            if is_new:
                self._start_anew(anew.value)
                return
        else:
            self.throttled.warn(
                "new_session",
                "odometry leapt faster than max_speed, or to its origin: where it is on the map is not known, and no "
                "correction is published, until constraints tie it there; ~/reset begins a new map",
            )
        with self._graph_lock:
            self._graph.begin_session(robot=follower.robot)

    # Closures

    def _take(self, closure: LoopClosure) -> None:
        if not self.is_enabled:
            self._leave(closure, "disabled")
        elif self.let_in(closure.to_ns):
            self._waiting.closures.append(closure)
            self._tie_what_waits()

    def _leave(self, closure: LoopClosure, reason: str, text: str = "") -> None:
        """Drop a closure; received again, it is a new one."""
        self._closures.forget_closure(closure)
        self.drop(closure.to_ns, reason, text)

    def _learn(self, closure: LoopClosure) -> None:
        """A closure that is known names its sessions."""
        with self._graph_lock:
            self._graph.learn_sessions(closure)

    def _withdraw(self, moments: Moments, robots: Robots = ("", "")) -> None:
        def is_meant(closure: LoopClosure) -> bool:
            return closure.moments == moments and may_be_same(closure.robots, robots)

        for closure in self._waiting.take_out(is_meant):
            self.drop(closure.to_ns, "retracted")
        with self._graph_lock:
            count = self._graph.withdraw(is_meant)
        self._withdrawn_count += count
        if count:
            self.worker.put((moments[3], None))

    def _tie_what_waits(self) -> None:
        with self._graph_lock:
            fates = self._waiting.tie(self._graph)
        for closure, reason, text in fates:
            if reason:
                self._leave(closure, reason, text)
            else:
                self.worker.put((closure.to_ns, closure))

    def _overtaken(self, job: tuple[int, LoopClosure | None]) -> None:
        if job[1] is not None:
            with self._graph_lock:
                self._riding.append(job[0])  # the newer job solves the graph with this closure in it

    def compute(self, stamp_ns: int, payload: LoopClosure | None) -> bool:
        """Solve the graph as it is now, and settle every closure that came until now."""
        with self._graph_lock:
            graph, problem, riding = self._graph, self._graph.problem(), len(self._riding)
        with self.accounting.timed("optimise"):
            solution = problem.solve() if payload is not None else self._without_withdrawn(problem)
        if solution is None:
            return False
        with self._graph_lock:
            settled, self._riding = self._riding[:riding], self._riding[riding:]
            if graph is self._graph:
                self._summary = graph.adopt_solution(problem, solution)
                for follower in self._followers.values():
                    follower.has_news = True
            summary = self._summary
        for stamp in settled:
            self.conclude(stamp, lambda: True)
        # The topic alone: TF is sent with odometry only, for its time must not go back.
        for follower in self._followers.values():
            self._publish_correction(follower, by_tf=False)
        self._out.pruned(summary.pruned, summary.residuals)
        return payload is not None

    def _without_withdrawn(self, problem: Problem) -> Solution | None:
        """A solution that no closure waits for, so that no drop reports what goes wrong; None then."""
        try:
            return problem.solve()
        except (RuntimeError, ValueError) as error:
            self.throttled.warn("retraction", f"the map is not solved without what was withdrawn: {error}")
            return None

    # Publish

    def _publish_paths(self) -> None:
        """The paths and the graph, where something is new and writing the last ones is not long enough ago."""
        news = {f: f.newest.stamp_ns for f in self._followers.values() if f.has_news and f.newest is not None}
        if not self.is_active or not news or time.monotonic() < self._path_due_s:
            return
        begun = time.monotonic()
        with self._graph_lock:
            for follower in news:
                follower.has_news = False
            placed = {f for f in news if self._graph.T_map_odom_of(f.robot) is not None}
            paths = [(f.robot, self._graph.path(f.robot) if f in placed else [], news[f]) for f in news]
            edges = self._graph.edges()
        for path in paths:
            self._out.path(*path)
        self._out.graph(*edges, max(news.values()))
        self._path_due_s = time.monotonic() + PATH_REST * (time.monotonic() - begun)

    def _publish_correction(self, follower: Follower, by_tf: bool) -> None:
        newest = follower.newest
        if not self.is_active or newest is None:  # it follows odometry all the same, so that the map is whole
            return
        with self._graph_lock:
            T_map_odom = self._graph.T_map_odom_of(follower.robot)
        if T_map_odom is not None:
            by_tf = by_tf and self._may_broadcast(follower, newest.frame_id)
            self._out.correction(follower.robot, T_map_odom, newest.stamp_ns, newest.frame_id, by_tf)

    def _may_broadcast(self, follower: Follower, odom_frame: str) -> bool:
        if not self._followers.share_frame(follower):
            return True
        if odom_frame not in self._shared_frames:
            self._shared_frames.add(odom_frame)
            self.get_logger().warning(
                f"two robots publish their odometry in {odom_frame!r}: their corrections are not broadcast on /tf; "
                "give the frames of each robot a prefix of its own"
            )
        return False

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What the last solution believed, and what is known of each robot."""
        summary, strain = self._summary, self._summary.strain
        own = MapperDiagnostics(
            **self._followers.counts(self._graph),
            sessions=len(self._graph.sessions),
            kept=len(summary.kept),
            pruned=len(summary.pruned),
            retracted=self._withdrawn_count,
            without_odometry=len(self._waiting.closures),
            against_odometry=strain.beyond,
            farthest=strain.farthest,
            suspicious=strain.is_suspicious,
        )
        return (*super().own_diagnostics(), own)

    def found(self) -> Sequence[Finding]:
        """Whether closures bend the map farther than odometry lets expect."""
        strain = self._summary.strain
        if not strain.is_suspicious:
            return ()
        what = f"{strain.beyond} of {strain.judged} constraints contradict odometry, by up to {strain.farthest}"
        cause = "they are false and agree with each other, or odometry is worse than odometry_*_error say"
        todo = "set trust to who is right, or these parameters to what odometry does"
        return (Finding(what, cause, todo, "constraints-against-odometry"),)

    # Services

    def _reset(self, _: Any, response: Any) -> Any:
        for follower in self._followers.values():
            follower.believe_next(self.settings.of(MapperParams).max_speed)
        self._start_anew("reset")
        response.success, response.message = True, "started a new map"
        return response

    def _save(self) -> tuple[bool, str]:
        """Whether both files are written, and where they are or why not."""
        try:
            with self._save_lock:
                with self._graph_lock:
                    (poses, edges), times = self._graph.flat(), self._graph.flat_times()
                    arrays = saved.packed(self._graph)
                require_ours(self._saved_file)
                write_graph(self._graph_file, graph_text(poses, edges), times_text(times))
                saved.save(arrays, self._saved_file)
        except OSError as error:
            return False, str(error)
        return True, f"{self._graph_file} and {self._saved_file.name}"


def main() -> int:
    """The executable ``mapper``."""
    return run(MapperNode)


if __name__ == "__main__":
    sys.exit(main())
