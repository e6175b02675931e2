# SPDX-License-Identifier: Apache-2.0
"""A node of these and what stands around it, in one executor: who sends constraints, and a stand-in of a consumer."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import Odometry as OdometryMsg
from rclpy.executors import SingleThreadedExecutor

from objreg_mapper.adapters.adapter import Adapter
from objreg_ros.bridge.messages import closures_msg, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import pose, rotation_from_vector

SECOND = 1_000_000_000
# A camera that looks ahead (z forward, x right) from 0.2 m in front of the body's middle and 0.5 m above it.
AHEAD = pose(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.2, 0.0, 0.5]))
AHEAD_TEXT = "[0.2, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5]"
SPREAD = np.array(np.random.default_rng(3).normal(size=(6, 6)))
COVARIANCE = 1e-4 * (SPREAD @ SPREAD.T + np.eye(6))
MEASURED = pose(rotation_from_vector(np.array([0.1, -0.2, 0.3])), np.array([0.4, -0.1, 0.25]))


def closure(from_s: float = 1.5, to_s: float = 63.25) -> LoopClosure:
    """A closure of which every number differs."""
    moments = {"from_ns": round(from_s * SECOND), "to_ns": round(to_s * SECOND)}
    return LoopClosure(T_from_to=MEASURED, covariance=COVARIANCE, labels=("cup",), **moments)


def body_at(seconds: float) -> np.ndarray:
    """A steady walk along a circle: what is between two of its poses lies on the way that joins them."""
    return pose(rotation_from_vector(np.array([0.0, 0.0, 0.05 * seconds])), np.array([0.1 * seconds, 0.0, 0.0]))


class Around:
    """Publishes for an adapter and waits until something is so."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("around")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.nodes: list[Adapter] = []
        self.constraints = self.node.create_publisher(OdometryMsg, "constraints", qos.latched(100))
        self.odom = self.node.create_publisher(OdometryMsg, "odom", qos.stage(1000))
        self.whole: Any = None
        if closures_msg.LoopClosureMsg is not None:
            self.whole = self.node.create_publisher(closures_msg.LoopClosureMsg, "loop_closures", qos.latched(100))

    def start(self, make: Callable[[], Adapter]) -> Adapter:
        self.nodes.append(make())
        self.executor.add_node(self.nodes[-1])
        return self.nodes[-1]

    def send(self, *closures: LoopClosure) -> None:
        for one in closures:
            self.constraints.publish(to_msg.constraint(one))

    def drive(self, node: Adapter, first_s: float, last_s: float, step_s: float = 0.5) -> None:
        """Odometry along the walk; it waits until the last message has been received."""
        self.wait(self.odom.get_subscription_count)
        stamps = np.arange(first_s, last_s + step_s / 2, step_s)
        for seconds in stamps:
            sample = Odometry(
                T_odom_body=body_at(seconds), stamp_ns=round(seconds * SECOND), child_frame_id="base_link"
            )
            self.odom.publish(to_msg.odometry(sample))
            self.wait(partial(_has_received, node, sample.stamp_ns))

    def wait(self, done: Callable[[], Any], seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not done():
            counters = [node.accounting.balance() for node in self.nodes]
            assert time.monotonic() < end, f"nothing came; the counters say {counters}"
            self.executor.spin_once(timeout_sec=0.02)

    def pass_time(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.close()
        self.node.destroy_node()


def _has_received(node: Any, stamp_ns: int) -> bool:
    newest = node._odom.newest
    return newest is not None and newest.stamp_ns >= stamp_ns


def begin(monkeypatch: pytest.MonkeyPatch, *parameters: str) -> None:
    """ROS with parameters for every node, on this machine only."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    given = [argument for one in parameters for argument in ("-p", one)]
    rclpy.init(args=["--ros-args", *given] if given else [])
