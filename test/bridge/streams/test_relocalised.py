# SPDX-License-Identifier: Apache-2.0
"""What the registrar publishes of its pose in an earlier map: topics, the plane, and the service."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.streams import relocalised
from objreg_ros.bridge.streams.params import RelocalisedParams
from objreg_ros.bridge.streams.relocalised import Answer, Whereabouts, on_plane, with_covariance
from objreg_ros.data.closures import Relocalised
from objreg_ros.geometry import pose, rotation_from_vector

AT = pose(rotation_from_vector(np.array([0.0, 0.0, 0.5])), np.array([1.0, 2.0, 3.0]))
FOUND = Relocalised(
    stamp_ns=7,
    session=4,
    target_ns=3,
    T_map_odom=AT,
    T_map_camera=AT,
    covariance=np.diag([1.0, 2, 3, 4, 5, 6]),
    closures=2,
)
ON_BODY = pose(np.eye(3), np.array([0.5, 0.0, 0.0]))
UNKNOWN: Answer = None, "no closure to an earlier session yet"
KNOWN: Answer = FOUND, "2 closures that agree"

Making = Callable[..., NodeBase]


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Making]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    made: list[NodeBase] = []

    def node(*parameters: str) -> NodeBase:
        settings = [part for one in parameters for part in ("-p", one)]
        rclpy.init(args=["asked", "--ros-args", *settings, "-r", "__ns:=/test_relocalised"])
        made.append(NodeBase("asked", RelocalisedParams))
        return made[-1]

    yield node
    for one in made:
        one.close()
    rclpy.try_shutdown()


def receive(node: NodeBase, topic: str) -> list[Any]:
    messages: list[Any] = []
    node.create_subscription(PoseWithCovarianceStamped, topic, messages.append, qos.latched())
    return messages


def wait_for(node: NodeBase, true: Callable[[], bool], seconds: float = 20.0) -> bool:
    deadline = time.monotonic() + seconds
    while not true() and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.05)
    return true()


def call(node: NodeBase, kind: type, **fields: float) -> Any:
    client = node.create_client(kind, "~/relocalise", callback_group=node.apart)
    assert client.wait_for_service(10.0)
    answer = client.call_async(kind.Request(**fields))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=30.0)
    return answer.result()


def test_what_becomes_known_is_published_once_and_again_after_it_was_forgotten(make: Making) -> None:
    node, answers = make("map_frame:=hall"), [UNKNOWN]
    whereabouts = Whereabouts(node, lambda: answers[-1])
    received = receive(node, "relocalised")
    whereabouts.mounted(ON_BODY)
    for answer in (UNKNOWN, KNOWN, KNOWN, UNKNOWN, KNOWN):
        answers.append(answer)
        whereabouts.look()
        wait_for(node, lambda: False, 0.2)
    assert len(received) == 2 and received[0].header.frame_id == "hall" and received[0].header.stamp.nanosec == 7
    at = received[0].pose.pose.position
    assert (at.x, at.y, at.z) == pytest.approx((1.0 - 0.5 * np.cos(0.5), 2.0 - 0.5 * np.sin(0.5), 3.0))
    assert received[0].pose.covariance[0] > 1.0 and received[0].pose.covariance[35] == 6.0
    assert node.count_publishers("initialpose") == 0


def test_initialpose_is_published_where_it_is_asked_for_and_lies_on_the_plane(make: Making) -> None:
    node = make("initialpose:=true")
    received = []
    node.create_subscription(PoseWithCovarianceStamped, "initialpose", received.append, qos.stage())
    whereabouts = Whereabouts(node, lambda: KNOWN)
    whereabouts.mounted(ON_BODY)
    assert wait_for(node, lambda: node.count_subscribers("initialpose") == 1)
    wait_for(node, lambda: False, 0.5)
    whereabouts.look()
    assert wait_for(node, lambda: bool(received))
    assert received[0].pose.pose.position.z == 0.0 and received[0].header.frame_id == "earlier_map"


@pytest.mark.parametrize(("by_odometry", "mount"), [(False, ON_BODY), (True, None)])
def test_no_initialpose_is_published_of_a_map_that_may_be_tilted_or_of_a_camera(
    by_odometry: bool, mount: np.ndarray | None, make: Making
) -> None:
    node, said, received = make("initialpose:=true"), list[str](), list[object]()
    node.throttled._write = said.append
    node.create_subscription(PoseWithCovarianceStamped, "initialpose", received.append, qos.stage())
    whereabouts = Whereabouts(node, lambda: (replace(FOUND, by_odometry=by_odometry), "known"))
    whereabouts.mounted(mount)
    assert wait_for(node, lambda: node.count_subscribers("initialpose") == 1)
    whereabouts.look()
    assert not wait_for(node, lambda: bool(received), 0.5)
    assert "expected odometry in both sessions" in said[0] and "set T_base_camera" in said[0]


def test_without_objreg_msgs_the_service_is_a_trigger_that_says_where_or_why_not(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relocalised, "Relocalise", None)
    node, answers = make(), [UNKNOWN]
    received = receive(node, "relocalised")
    Whereabouts(node, lambda: answers[-1])
    answer = call(node, Trigger)
    assert not answer.success and answer.message == UNKNOWN[1]
    answers.append(KNOWN)
    answer = call(node, Trigger)
    assert answer.success and answer.message == "session 4 at 1.000 2.000 3.000 m: 2 closures that agree"
    assert wait_for(node, lambda: bool(received))


@pytest.mark.skipif(relocalised.Relocalise is None, reason="objreg_msgs is not installed")
def test_the_service_of_objreg_msgs_waits_as_long_as_it_is_asked_to(make: Making) -> None:
    node, begun = make(), time.monotonic()
    Whereabouts(node, lambda: KNOWN if time.monotonic() - begun > 2.0 else UNKNOWN)
    answer = call(node, relocalised.Relocalise, wait_seconds=0.0)
    assert not answer.success and answer.message == UNKNOWN[1] and not answer.session
    answer = call(node, relocalised.Relocalise, wait_seconds=20.0)
    assert answer.success and answer.session == "4" and answer.pose.pose.pose.position.z == 3.0
    for seconds in (-1.0, float("nan"), 1e9):
        answer = call(node, relocalised.Relocalise, wait_seconds=seconds)
        assert not answer.success and answer.message.startswith("wait_seconds: expected 0 to 60, got")


def test_the_plane_keeps_x_y_and_yaw_and_their_covariance() -> None:
    tilted = pose(
        rotation_from_vector(np.array([0.0, 0.0, 0.5])) @ rotation_from_vector(np.array([0.3, 0.2, 0.0])), AT[:3, 3]
    )
    flat = on_plane(with_covariance(tilted, np.arange(36.0).reshape(6, 6), 7, "map"))
    at, turn = flat.pose.pose.position, flat.pose.pose.orientation
    assert (at.x, at.y, at.z, turn.x, turn.y) == (1.0, 2.0, 0.0, 0.0, 0.0)
    ahead = tilted[:3, 0]
    assert 2.0 * np.arctan2(turn.z, turn.w) == pytest.approx(np.arctan2(ahead[1], ahead[0]))
    kept = np.reshape(flat.pose.covariance, (6, 6))
    assert np.argwhere(kept.any(axis=0)).ravel().tolist() == [0, 1, 5] and kept[0, 5] == 5.0
    assert flat.header.frame_id == "map"


def test_a_body_that_looks_straight_up_has_the_yaw_of_its_left() -> None:
    up = pose(np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros(3))
    turn = on_plane(with_covariance(up, np.eye(6), 0, "map")).pose.pose.orientation
    assert abs(turn.z) < 1e-9  # its y is the map's y


def test_who_finds_too_many_waiting_is_answered_at_once_and_costs_no_thread(make: Making) -> None:
    node = make()
    where, before = Whereabouts(node, lambda: UNKNOWN), threading.active_count()
    answered = []
    asked = [where._relocalise(SimpleNamespace(wait_seconds=0.5), SimpleNamespace()) for _ in range(19)]
    for one in asked:
        try:
            one.send(None)
        except StopIteration as end:
            answered.append(end.value.message)
    assert threading.active_count() - before == relocalised.MOST_WAITING and answered == [UNKNOWN[1]] * 3


def test_who_comes_after_it_has_become_unknown_gets_no_pose_of_before(make: Making) -> None:
    node, answers = make(), [KNOWN]
    where = Whereabouts(node, lambda: answers[-1])
    before = receive(node, "relocalised")
    where.look()
    assert wait_for(node, lambda: len(before) == 1)
    answers.append(UNKNOWN)
    where.look()
    late = receive(node, "relocalised")
    assert not wait_for(node, lambda: bool(late), 1.0)
    answers.append(KNOWN)
    where.look()
    assert wait_for(node, lambda: len(late) == 1 and len(before) == 2)
