# SPDX-License-Identifier: Apache-2.0
"""The mapper's node behind its node, with two robots that drive at the same time."""

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

from objreg_mapper.node import MapperNode
from objreg_ros.bridge.messages import motion_from_msg, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.closures import LoopClosure
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import pose, rotation_from_vector

from .bent import SECOND, closure, odometry, square
from .test_node import Broadcaster

TRUE = square(laps=2)
HALF = len(TRUE) // 2
ELSEWHERE = pose(rotation_from_vector(np.array([0.0, 0.0, 0.7])), np.array([5.0, -3.0, 0.0]))
LAPS = {"a": TRUE[:HALF], "b": TRUE[HALF : 2 * HALF]}
WALKS = {"a": odometry(LAPS["a"]), "b": odometry([ELSEWHERE @ T for T in LAPS["b"]])}


def met(a: int, b: int) -> LoopClosure:
    """What the one robot saw at its step and the other at its own."""
    closed = replace(closure(TRUE, a, HALF + b), from_ns=a * SECOND // 10, to_ns=b * SECOND // 10)
    return replace(closed, from_robot="fleet/a", to_robot="fleet/b", from_session=0, to_session=0)


class Fleet:
    """Two robots in the namespace of the mapper, each with its topics in one of its own."""

    def __init__(self) -> None:
        self.node = MapperNode()
        self.peer = rclpy.create_node("outside")
        self.paths: dict[str, list[Any]] = {"a": [], "b": []}
        self.corrections: dict[str, list[Any]] = {"a": [], "b": []}
        self.odom = {}
        for robot in "ab":
            self.odom[robot] = self.peer.create_publisher(OdometryMsg, f"{robot}/odom", qos.stage(1000))
            self.peer.create_subscription(PathMsg, f"{robot}/path", self.paths[robot].append, qos.latched())
            received = self.corrections[robot].append
            self.peer.create_subscription(TransformStamped, f"{robot}/correction", received, qos.latched())
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        topics = {publisher.topic_name for publisher in self.odom.values()}
        subscriptions = [one for one in self.node.subscriptions if one.topic_name in topics]
        self.wait(lambda: len(subscriptions) == 2 and all(one.get_publisher_count() for one in subscriptions))
        self.wait(lambda: all(publisher.get_subscription_count() for publisher in self.odom.values()))

    def wait(self, done: Callable[[], Any], seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, f"nothing came; known is {by_key(*self.node.own_diagnostics())}"
            self.executor.spin_once(timeout_sec=0.05)

    def diagnostic(self, robot: str, key: str) -> Any:
        return by_key(*self.node.own_diagnostics())[f"fleet/{robot}: {key}"]

    def drive(self, steps: range) -> None:
        """Odometry of both, pose by pose in turn."""
        for k in steps:
            for robot, walk in WALKS.items():
                self.odom[robot].publish(to_msg.odometry(replace(walk[k], frame_id=f"{robot}/odom")))
        self.wait(lambda: all(self.diagnostic(robot, "odometry") == steps.stop for robot in "ab"))

    def close(self, known: LoopClosure) -> None:
        """As a closure of objreg_msgs, which need not be installed."""
        self.node.accept(known.to_ns)
        self.node._take(known)


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    params = ["-p", f"graph_path:={tmp_path}/map.g2o", "-p", "robots:=[a, b]", "-r", "__ns:=/fleet"]
    rclpy.init(args=["--ros-args", *params])
    around = Fleet()
    yield around
    around.executor.shutdown()
    around.node.close()
    around.peer.destroy_node()
    rclpy.try_shutdown()


def test_each_robot_has_its_path_and_correction_once_closures_tie_it_to_the_first(fleet: Fleet) -> None:
    fleet.drive(range(HALF))
    fleet.wait(lambda: fleet.paths["a"] and len(fleet.paths["a"][-1].poses) == fleet.diagnostic("a", "keyframes"))
    assert (fleet.diagnostic("a", "placed in the map"), fleet.diagnostic("b", "placed in the map")) == (True, False)
    assert not fleet.corrections["b"] and not any(path.poses for path in fleet.paths["b"])
    for a, b in ((40, 10), (20, 20), (70, 72)):
        fleet.close(met(a, b))
    fleet.wait(lambda: fleet.corrections["b"] and fleet.paths["b"] and fleet.paths["b"][-1].poses)
    fleet.wait(lambda: by_key(*fleet.node.own_diagnostics())["constraints kept"] == 3)
    fleet.wait(lambda: fleet.node.accounting.balance().waiting == 0)
    frames = {robot: (sent[-1].header.frame_id, sent[-1].child_frame_id) for robot, sent in fleet.corrections.items()}
    assert frames == {"a": ("map", "a/odom"), "b": ("map", "b/odom")}

    def end() -> np.ndarray:
        return motion_from_msg.odometry(fleet.corrections["b"][-1]).T_odom_body @ WALKS["b"][-1].T_odom_body

    fleet.wait(lambda: np.linalg.norm(end()[:3, 3] - LAPS["b"][-1][:3, 3]) < 0.05)


def test_a_robot_whose_time_jumps_back_begins_a_session_and_leaves_the_other_alone(fleet: Fleet) -> None:
    fleet.drive(range(40))
    keyframes = fleet.diagnostic("a", "keyframes")
    for sample in WALKS["b"][:3]:
        fleet.node._on_odometry(to_msg.odometry(sample), "fleet/b")
    assert (fleet.diagnostic("b", "keyframes"), fleet.diagnostic("a", "keyframes")) == (1, keyframes)
    assert by_key(*fleet.node.own_diagnostics())["sessions"] == 3 and fleet.diagnostic("a", "odometry passed over") == 0


def test_a_closure_of_a_robot_that_is_not_named_is_dropped(fleet: Fleet) -> None:
    fleet.drive(range(5))
    fleet.close(replace(met(3, 4), to_robot="fleet/c"))
    assert fleet.node.accounting.balance().dropped == {"unknown_robot": 1}


def test_frames_of_one_name_are_not_broadcast_and_that_is_said_once(
    fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("objreg_ros.bridge.streams.map_announcements.TransformBroadcaster", Broadcaster)
    broadcaster = fleet.node._out._broadcaster = Broadcaster(fleet.node)
    said: list[str] = []
    monkeypatch.setattr(fleet.node, "get_logger", lambda: SimpleNamespace(warning=said.append))
    for k in range(4):
        for robot, frame in (("a", "odom"), ("b", "odom" if k else "b/odom")):
            sample = replace(WALKS[robot][k], frame_id=frame)
            fleet.node._on_odometry(to_msg.odometry(sample), f"fleet/{robot}")
    assert [message.child_frame_id for message in broadcaster.sent] == ["odom", "odom"]  # until b names the same
    assert len(said) == 1 and "two robots publish their odometry in 'odom'" in said[0]


def test_a_saved_map_is_gone_on_with_by_both(fleet: Fleet) -> None:
    fleet.drive(range(HALF))
    for a, b in ((40, 10), (20, 20)):
        fleet.close(met(a, b))
    fleet.wait(lambda: fleet.diagnostic("b", "placed in the map"))
    assert fleet.node._save()[0]
    fleet.node._inputs = fleet.node._inputs.replaced(resume=True)
    fleet.node._begin(fleet.node._resumed())
    assert [one.robot for one in fleet.node._graph.sessions] == ["fleet/a", "fleet/b"]
    assert (fleet.diagnostic("a", "placed in the map"), fleet.diagnostic("b", "placed in the map")) == (False, False)
    for robot in "ab":
        later = replace(WALKS[robot][0], stamp_ns=1000 * SECOND)
        fleet.node._followers[f"fleet/{robot}"].believe_next(5.0)
        fleet.node._on_odometry(to_msg.odometry(later), f"fleet/{robot}")
    assert [one.robot for one in fleet.node._graph.sessions] == ["fleet/a", "fleet/b"] * 2
