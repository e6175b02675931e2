# SPDX-License-Identifier: Apache-2.0
"""The mapper behind its node: messages in, messages out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry as OdometryMsg
from nav_msgs.msg import Path as PathMsg
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from objreg_mapper.node import MapperNode
from objreg_mapper.optimisation.keyframe_graph import KeyframeGraph
from objreg_mapper.optimisation.problem import Solution, Tie
from objreg_mapper.pose_graph import Problem
from objreg_ros.bridge.messages import headers, motion_from_msg, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.log import ThrottledLog
from objreg_ros.data.closures import LoopClosure
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import pose, rotation_from_vector

from .bent import SECOND, bent, closure, odometry, square

TRUE = square(laps=2)
BENT = bent(TRUE)
HALF = len(TRUE) // 2
ROUND_TRIP = [closure(TRUE, k, k + HALF) for k in range(3, HALF, 20)]


def reported(node: MapperNode) -> dict[str, Any]:
    """What the mapper reports of itself, by key."""
    return by_key(*node.own_diagnostics())


class Outside:
    """What stands outside the node: publishes odometry and constraints, and receives the path and the correction."""

    def __init__(self, node: MapperNode) -> None:
        self.node = node
        self.peer = rclpy.create_node("outside")
        self.paths: list[Any] = []
        self.corrections: list[Any] = []
        self.odom = self.peer.create_publisher(OdometryMsg, "odom", qos.stage(1000))
        self.constraints = self.peer.create_publisher(OdometryMsg, "constraints", qos.latched(100))
        self.peer.create_subscription(PathMsg, "path", self.paths.append, qos.latched())
        self.peer.create_subscription(TransformStamped, "correction", self.corrections.append, qos.latched())
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(node)
        self.executor.add_node(self.peer)
        self.wait(lambda: self.odom.get_subscription_count() and self.constraints.get_subscription_count())
        self.wait(self._is_received)  # a reader that has not met its writer yet misses what that sends

    def _is_received(self) -> bool:
        names = self.odom.topic_name, self.constraints.topic_name
        return all(one.get_publisher_count() for one in self.node.subscriptions if one.topic_name in names)

    def wait(self, done: Callable[[], Any], seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, f"nothing came; the counters say {self.node.accounting.balance()}"
            self.executor.spin_once(timeout_sec=0.05)

    def drive(self, poses: list[np.ndarray]) -> None:
        """Odometry in the camera's stead: one message at a time, so that none is lost on the way."""
        for count, sample in enumerate(odometry(poses), start=1):
            self.odom.publish(to_msg.odometry(sample))
            self.wait(lambda count=count: reported(self.node)["odometry"] >= count)

    def send(self, closures: list[LoopClosure]) -> None:
        for constraint in closures:
            self.constraints.publish(to_msg.constraint(constraint))

    def settled(self) -> bool:
        balance = self.node.accounting.balance()
        return balance.received > 0 and balance.waiting == 0


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Outside]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=["--ros-args", "-p", f"graph_path:={tmp_path}/map.g2o"])
    around = Outside(MapperNode())
    yield around
    around.executor.shutdown()
    around.node.close()
    around.peer.destroy_node()
    rclpy.try_shutdown()


def end_of(path: Any) -> np.ndarray:
    return motion_from_msg.odometry(path.poses[-1]).T_odom_body


def test_the_path_ends_where_the_walk_began_once_constraints_are_in(outside: Outside) -> None:
    outside.send(ROUND_TRIP[:1])  # before its odometry: it waits
    outside.drive(BENT)
    outside.send(ROUND_TRIP[1:])
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))
    outside.wait(outside.settled)
    outside.wait(lambda: np.linalg.norm(end_of(outside.paths[-1])[:3, 3]) < 0.3 * np.linalg.norm(BENT[-1][:3, 3]))
    assert outside.paths[-1].header.frame_id == "map"
    assert outside.node.accounting.balance().published == len(ROUND_TRIP)


def test_the_path_grows_with_every_keyframe_before_any_constraint(outside: Outside) -> None:
    outside.drive(BENT[:40])
    keyframes = reported(outside.node)["keyframes"]
    outside.wait(lambda: outside.paths and len(outside.paths[-1].poses) == keyframes > 3)


def test_the_correction_carries_odom_to_map(outside: Outside) -> None:
    outside.drive(BENT)
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))

    def end() -> np.ndarray:
        return motion_from_msg.odometry(outside.corrections[-1]).T_odom_body @ BENT[-1]

    outside.wait(lambda: np.linalg.norm(end()[:3, 3]) < 0.3 * np.linalg.norm(BENT[-1][:3, 3]))
    assert (outside.corrections[-1].header.frame_id, outside.corrections[-1].child_frame_id) == ("map", "odom")


def test_a_wrong_constraint_is_pruned_and_reported(outside: Outside) -> None:
    off = pose(rotation_from_vector(np.array([0.0, 0.0, 1.2])), np.array([0.8, 0.6, 0.0]))
    outside.drive(BENT)
    outside.send([*ROUND_TRIP, closure(TRUE, 10, 90, off)])
    outside.wait(lambda: reported(outside.node)["constraints pruned"] == 1)
    assert reported(outside.node)["constraints kept"] == len(ROUND_TRIP)


def test_a_live_parameter_holds_from_the_next_solution_on(outside: Outside) -> None:
    off = pose(rotation_from_vector(np.array([0.0, 0.0, 1.2])), np.array([0.8, 0.6, 0.0]))
    outside.node.set_parameters([Parameter("max_residual", value=1e6)])
    outside.drive(BENT)
    outside.send([*ROUND_TRIP, closure(TRUE, 10, 90, off)])
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP) + 1)
    outside.node.set_parameters([Parameter("max_residual", value=5.0)])
    outside.send([closure(TRUE, 11, 11 + HALF)])
    outside.wait(lambda: reported(outside.node)["constraints pruned"] == 1)


def test_what_cannot_be_used_is_dropped_by_reason(outside: Outside) -> None:
    malformed = to_msg.constraint(ROUND_TRIP[0])
    malformed.header.frame_id = "camera"
    outside.constraints.publish(malformed)
    outside.drive(BENT[:20])
    outside.send([closure(TRUE, -30, 10)])
    outside.send([closure(TRUE, 10, 5)])
    outside.wait(lambda: outside.node.accounting.balance().received == 3 and outside.settled())
    dropped = outside.node.accounting.balance().dropped
    assert dropped == {"malformed_constraints": 1, "before_odometry": 1, "two_clocks": 1}


def test_odometry_that_begins_anew_elsewhere_is_on_the_map_once_constraints_tie_it_there(outside: Outside) -> None:
    walk = odometry(BENT)
    outside.drive(BENT[:HALF])
    outside.wait(lambda: outside.corrections)
    away = pose(np.eye(3), np.array([3.0, 0.0, 0.0]))
    for count, sample in enumerate(walk[HALF:], start=HALF - 1):  # the first two of them are held back
        outside.odom.publish(to_msg.odometry(replace(sample, T_odom_body=away @ sample.T_odom_body)))
        outside.wait(lambda count=count: reported(outside.node)["odometry"] >= min(count, HALF))
    outside.wait(lambda: reported(outside.node)["odometry"] == len(walk))
    status = reported(outside.node)
    assert (status["sessions"], status["placed in the map"]) == (2, False)
    assert headers.stamp_ns(outside.corrections[-1]) < walk[HALF].stamp_ns  # where it is now nobody knows
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(outside.node)["placed in the map"] and outside.settled())
    outside.wait(
        lambda: outside.paths and outside.paths[-1].poses and np.linalg.norm(end_of(outside.paths[-1])[:3, 3]) < 0.5
    )


def test_two_publishers_of_odometry_do_not_fill_the_log(outside: Outside, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    log = SimpleNamespace(warning=said.append)
    monkeypatch.setattr(outside.node, "get_logger", lambda: log)
    monkeypatch.setattr(outside.node, "throttled", ThrottledLog(log.warning))
    away = pose(np.eye(3), np.array([3.0, 0.0, 0.0]))
    for sample in odometry([away @ T if k % 2 else T for k, T in enumerate(BENT[:20])]):
        outside.node._on_odometry(to_msg.odometry(sample))
    assert reported(outside.node)["odometry"] == 10
    assert len(said) == 1 and "more than one publisher" in said[0]


def test_a_constraint_within_a_gap_of_the_odometry_is_dropped(outside: Outside) -> None:
    outside.drive(BENT[:20])
    for sample in odometry(BENT)[60:62]:
        outside.odom.publish(to_msg.odometry(sample))
    outside.wait(lambda: reported(outside.node)["odometry"] == 22)
    outside.send([closure(TRUE, 5, 40)])
    outside.wait(lambda: outside.node.accounting.balance().dropped == {"odometry_gap": 1})


def test_a_constraint_from_the_very_first_moment_waits_for_the_second(outside: Outside) -> None:
    outside.drive(BENT[:5])
    outside.send([closure(TRUE, 0, 90)])
    outside.wait(lambda: reported(outside.node)["constraints without odometry"] == 1)
    assert not outside.node.accounting.balance().dropped


def test_what_was_solved_when_a_reset_came_is_of_no_map(outside: Outside, monkeypatch: pytest.MonkeyPatch) -> None:
    outside.drive(BENT)
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))
    outside.wait(outside.settled)
    node, solve = outside.node, Problem.solve

    def reset_meanwhile(problem: Problem) -> Solution:
        node._reset(None, Trigger.Response())
        return solve(problem)

    monkeypatch.setattr(Problem, "solve", reset_meanwhile)
    node.compute(0, None)
    assert (reported(node)["keyframes"], reported(node)["constraints kept"]) == (0, 0)


def test_a_jump_back_in_time_starts_a_new_map(outside: Outside) -> None:
    outside.drive(BENT[:40])
    keyframes = reported(outside.node)["keyframes"]
    for again in odometry(BENT)[:3]:
        outside.odom.publish(to_msg.odometry(again))
    outside.wait(lambda: reported(outside.node)["keyframes"] == 1)
    assert keyframes > 3


def test_a_jump_back_in_time_is_another_session_where_closures_name_them(outside: Outside) -> None:
    walk = odometry(BENT)
    outside.drive(BENT[:40])
    node = outside.node
    node._learn(replace(closure(TRUE, 5, 30), from_session=1, to_session=1))
    for again in walk[:30]:
        outside.odom.publish(to_msg.odometry(again))
    outside.wait(lambda: reported(node)["odometry"] == 70)
    assert (reported(node)["sessions"], reported(node)["placed in the map"]) == (2, False)
    for k in (3, 15):
        node._take(replace(closure(TRUE, k + 5, k), from_session=1, to_session=2))
    outside.wait(lambda: reported(node)["placed in the map"])
    assert reported(node)["constraints kept"] == 2


def test_odometry_that_comes_late_is_passed_over_and_counted_and_leaves_the_map(outside: Outside) -> None:
    node = outside.node
    outside.drive(BENT)
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(node)["constraints kept"] == len(ROUND_TRIP))
    keyframes, correction = reported(node)["keyframes"], node._graph.T_map_odom
    for steps_back in (2, 10):  # 0.1 s and 0.9 s before the last
        outside.odom.publish(to_msg.odometry(odometry(BENT)[-steps_back]))
    outside.wait(lambda: reported(node)["odometry passed over"] == 2)
    assert (reported(node)["keyframes"], reported(node)["odometry"]) == (keyframes, len(BENT))
    np.testing.assert_array_equal(node._graph.T_map_odom, correction)
    for steps_back in (45, 44, 43):  # seconds: the clock was set back, as the next two follow
        assert reported(node)["keyframes"] == keyframes
        outside.odom.publish(to_msg.odometry(odometry(BENT)[-steps_back]))
    outside.wait(lambda: reported(node)["keyframes"] == 1)


def test_one_odometry_with_a_wrong_stamp_leaves_the_map(outside: Outside) -> None:
    node = outside.node
    outside.drive(BENT[:60])
    for stamp_ns in (0, odometry(BENT)[60].stamp_ns + 3600 * 10**9):
        outside.odom.publish(to_msg.odometry(replace(odometry(BENT)[60], stamp_ns=stamp_ns)))
        outside.odom.publish(to_msg.odometry(odometry(BENT)[60 if stamp_ns == 0 else 61]))
    outside.wait(lambda: reported(node)["odometry"] == 62)
    assert reported(node)["odometry passed over"] == 2 and reported(node)["keyframes"] > 1


def test_one_pose_that_leaps_and_two_stale_ones_leave_the_map(outside: Outside) -> None:
    node, walk = outside.node, odometry(BENT)
    outside.drive(BENT[:60])
    keyframes = reported(node)["keyframes"]
    away = pose(np.eye(3), np.array([30.0, 0.0, 0.0]))
    outlier = replace(walk[60], T_odom_body=away @ walk[60].T_odom_body)
    for sample in (outlier, walk[61], walk[5], walk[6], walk[62]):
        outside.odom.publish(to_msg.odometry(sample))
    outside.wait(lambda: reported(node)["odometry"] == 62)
    assert reported(node)["odometry passed over"] == 3
    assert reported(node)["keyframes"] >= keyframes and node._graph.keyframes.stamps_ns[0] == 0


def test_a_constraint_that_no_body_can_have_gone_is_dropped_as_implausible(outside: Outside) -> None:
    outside.drive(BENT)
    far = [closure(TRUE, k, 90, pose(np.eye(3), np.array([x, 0.0, 0.0]))) for k, x in ((10, 50.0), (11, 1e9))]
    outside.send([*ROUND_TRIP, *far])
    outside.wait(lambda: outside.node.accounting.balance().dropped == {"implausible": 2} and outside.settled())
    assert reported(outside.node)["constraints kept"] == len(ROUND_TRIP)


def test_a_constraint_that_makes_solutions_fail_is_pruned_and_the_map_goes_on(
    outside: Outside, monkeypatch: pytest.MonkeyPatch
) -> None:
    close, poison = KeyframeGraph.close, closure(TRUE, 10, 90)

    def fail(graph: KeyframeGraph, problem: Problem, tie: Tie) -> int:
        if tie.closure is not None and tie.closure.to_ns == poison.to_ns:
            raise RuntimeError("indeterminate")
        return close(graph, problem, tie)

    monkeypatch.setattr(KeyframeGraph, "close", fail)
    outside.drive(BENT)
    outside.send([ROUND_TRIP[0], poison, *ROUND_TRIP[1:]])
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))
    outside.wait(lambda: reported(outside.node)["constraints pruned"] == 1 and outside.settled())


def test_constraints_that_wait_do_not_outlive_a_jump_back_in_time_or_a_reset(outside: Outside) -> None:
    node, ahead = outside.node, [closure(TRUE, 10, 90), closure(TRUE, 12, 92)]
    outside.drive(BENT[:40])
    outside.send(ahead[:1])
    outside.wait(lambda: reported(node)["constraints without odometry"] == 1)
    for again in odometry(BENT)[:3]:
        outside.odom.publish(to_msg.odometry(again))
    outside.wait(lambda: node.accounting.balance().dropped == {"time_jump": 1})
    outside.send(ahead[1:])
    outside.wait(lambda: reported(node)["constraints without odometry"] == 1)
    assert node._reset(None, Trigger.Response()).success
    assert node.accounting.balance().dropped == {"time_jump": 1, "reset": 1}
    assert outside.settled() and reported(node)["constraints without odometry"] == 0


def test_a_constraint_that_was_found_before_time_jumped_back_is_not_tied_after_it(outside: Outside) -> None:
    outside.drive(BENT[:60])
    for again in odometry(BENT)[:3]:
        outside.odom.publish(to_msg.odometry(again))
    outside.wait(lambda: reported(outside.node)["keyframes"] == 1)
    outside.send([closure(TRUE, 5, 58), closure(TRUE, 0, 8)])
    outside.wait(lambda: outside.node.accounting.balance().dropped == {"time_jump": 1})
    outside.wait(lambda: reported(outside.node)["constraints without odometry"] == 1)


def test_without_odometry_the_oldest_constraints_make_room(outside: Outside) -> None:
    outside.node._waiting.most = 2
    outside.send(ROUND_TRIP[:3])
    outside.wait(lambda: outside.node.accounting.balance().received == 3)
    assert outside.node.accounting.balance().dropped == {"queue_full": 1}
    assert [constraint.to_ns for constraint in outside.node._waiting.closures] == [
        constraint.to_ns for constraint in ROUND_TRIP[1:3]
    ]


def test_the_services_answer(outside: Outside, tmp_path: Path) -> None:
    outside.drive(BENT[:40])
    node = outside.node
    offered = {name for name, _ in node.get_service_names_and_types_by_node("mapper", "/")}
    assert offered >= {"/mapper/reset", "/mapper/save", "/mapper/enable"}
    saved, message = node._save()
    assert saved and message == f"{tmp_path / 'map.g2o'} and map.npz"
    text = (tmp_path / "map.g2o").read_text()
    assert text.count("VERTEX_SE3:QUAT") == len(node._graph.keyframes) == text.count("EDGE_SE3:QUAT") + 1
    node.is_enabled = False
    outside.send(ROUND_TRIP[:1])
    outside.wait(lambda: node.accounting.balance().dropped == {"disabled": 1})
    assert node._reset(None, Trigger.Response()).success
    assert reported(node)["keyframes"] == 0


def test_after_a_reset_the_same_constraints_are_of_the_new_map(outside: Outside) -> None:
    node = outside.node
    for _ in range(2):
        for sample in odometry(BENT):
            node._on_odometry(to_msg.odometry(sample))
        for constraint in ROUND_TRIP:
            node._closures._on_constraint(to_msg.constraint(constraint))
        outside.wait(lambda: reported(node)["constraints kept"] == len(ROUND_TRIP))
        outside.wait(outside.settled)
        assert node._reset(None, Trigger.Response()).success
    assert node.accounting.balance().published == 2 * len(ROUND_TRIP)


def test_a_retracted_constraint_leaves_the_map(outside: Outside) -> None:
    outside.drive(BENT)
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))
    outside.node._withdraw(ROUND_TRIP[0].moments)
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP) - 1)
    assert reported(outside.node)["constraints retracted"] == 1 and outside.settled()


def test_a_saved_map_is_gone_on_with(outside: Outside) -> None:
    outside.drive(BENT)
    outside.send(ROUND_TRIP)
    outside.wait(lambda: reported(outside.node)["constraints kept"] == len(ROUND_TRIP))
    outside.wait(outside.settled)
    assert outside.node._save()[0]
    outside.node._inputs = outside.node._inputs.replaced(resume=True)
    resumed = outside.node._resumed()
    outside.node._begin(resumed)
    status = reported(outside.node)
    assert (status["sessions"], status["placed in the map"], status["constraints kept"]) == (1, False, len(ROUND_TRIP))


def test_a_stamp_that_repeats_is_passed_over(outside: Outside) -> None:
    outside.drive(BENT[:5])
    outside.odom.publish(to_msg.odometry(odometry(BENT)[4]))
    outside.odom.publish(to_msg.odometry(odometry(BENT)[5]))
    outside.wait(lambda: reported(outside.node)["odometry"] == 6)
    assert reported(outside.node)["odometry passed over"] == 1
    assert outside.node._graph.odometry.stamps_ns[-1] == SECOND // 2


class Broadcaster:
    """Stands in for tf2_ros' and keeps what it was given."""

    def __init__(self, node: Any) -> None:
        self.sent: list[Any] = []

    def sendTransform(self, transform: Any) -> None:
        self.sent.append(transform)


def test_every_odometry_that_is_not_late_brings_the_correction_to_tf(
    outside: Outside, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("objreg_ros.bridge.streams.map_announcements.TransformBroadcaster", Broadcaster)
    broadcaster = outside.node._out._broadcaster = Broadcaster(outside.node)
    for sample in odometry(BENT[:3]):
        outside.node._on_odometry(to_msg.odometry(sample))
        outside.node._on_odometry(to_msg.odometry(replace(sample, stamp_ns=sample.stamp_ns - 1000)))
    assert [headers.stamp_ns(message) for message in broadcaster.sent] == [w.stamp_ns for w in odometry(BENT[:3])]
    assert {(m.header.frame_id, m.child_frame_id) for m in broadcaster.sent} == {("map", "odom")}


def test_the_correction_is_of_the_frame_that_odometry_is_in(outside: Outside, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.bridge.streams.map_announcements.TransformBroadcaster", Broadcaster)
    broadcaster = outside.node._out._broadcaster = Broadcaster(outside.node)
    outside.node._on_odometry(to_msg.odometry(replace(odometry(BENT)[0], frame_id="world")))
    assert [(m.header.frame_id, m.child_frame_id) for m in broadcaster.sent] == [("map", "world")]


def test_the_broadcast_is_switched_off_and_on_while_the_node_runs(
    outside: Outside, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("objreg_ros.bridge.streams.map_announcements.TransformBroadcaster", Broadcaster)
    outside.node._out._broadcaster = None
    sent: list[int] = []
    for k, publish_tf in enumerate((False, True, False)):
        outside.node.set_parameters([Parameter("publish_tf", value=publish_tf)])
        outside.node._on_odometry(to_msg.odometry(odometry(BENT)[k]))
        sent.append(len(outside.node._out._broadcaster.sent) if outside.node._out._broadcaster else 0)
    assert sent == [0, 1, 1]


def test_nobody_sets_where_a_save_goes_while_the_node_runs(outside: Outside, tmp_path: Path) -> None:
    outside.drive(BENT[:20])
    (refused,) = outside.node.set_parameters([Parameter("graph_path", value=str(tmp_path / "other.g2o"))])
    assert not refused.successful and outside.node._save()[0]
    assert {path.name for path in tmp_path.glob("*.g2o")} == {"map.g2o"}


def test_a_save_keeps_a_file_of_another_kind_that_came_to_its_place(outside: Outside, tmp_path: Path) -> None:
    outside.drive(BENT[:20])
    (tmp_path / "map.npz").write_text("precious")
    saved, message = outside.node._save()
    assert not saved and "map.npz: expected a map or none, got another file" in message
    assert (tmp_path / "map.npz").read_text() == "precious" and not (tmp_path / "map.g2o").exists()


@pytest.mark.parametrize("publish_tf", [True, False])
def test_the_correction_is_broadcast_unless_that_is_switched_off(
    publish_tf: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("objreg_ros.bridge.streams.map_announcements.TransformBroadcaster", Broadcaster)
    rclpy.init(args=["--ros-args", "-p", f"publish_tf:={publish_tf}".lower()])
    node = MapperNode()
    try:
        node._on_odometry(to_msg.odometry(odometry(BENT)[0]))
        assert (node._out._broadcaster is not None) == publish_tf
    finally:
        node.close()
        rclpy.try_shutdown()
