# SPDX-License-Identifier: Apache-2.0
"""What the registrar publishes, on topics of common_interfaces and, where it is installed, of objreg_msgs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.node import Node

from objreg_ros.bridge.messages import closures_msg, localisation_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams.announcements import Announcements, LocalisationAnnouncements
from objreg_ros.data.closures import LoopClosure, Observation, Reason, Rejected
from objreg_ros.data.localisation import LocalisationState, State

CLOSURE = LoopClosure(from_ns=5, to_ns=9, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), to_session=1)
REJECTED = Rejected(reason=Reason.NO_CANDIDATE, from_ns=9, to_ns=9, detail="none of 3")
SEEN = (Observation(label="cup", object_id=4, xyz=np.array([0.0, 0.0, 1.0])),)
COMMON = {"acceptances", "constraints", "landmarks", "markers", "refusals", "transforms"}
WHOLE = {"closure_refusals", "loop_closures", "object_landmarks"}


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    rclpy.init()
    made = Node("announcer", namespace="/fleet/robot1")
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def topics(node: Node) -> set[str]:
    publishers = node.get_publisher_names_and_types_by_node("announcer", "/fleet/robot1")
    return {name.rpartition("/")[2] for name, _ in publishers} & (COMMON | WHOLE)


def received(node: Node, kind: type, topic: str, profile: Any) -> list[Any]:
    """Collects the messages of a topic."""
    messages: list[Any] = []
    node.create_subscription(kind, topic, messages.append, profile)
    return messages


def wait_for(node: Node, *clusters: list[Any]) -> None:
    deadline = time.monotonic() + 60.0
    while not all(clusters) and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.1)


def test_without_objreg_msgs_the_other_topics_are_as_they_are_with_it(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closures_msg, "LoopClosureMsg", None)
    announcements = Announcements(node)
    announcements.closures([CLOSURE])
    announcements.refusals([REJECTED])
    announcements.landmarks(SEEN, 9, "kinect", {0: "cup"}, 1)
    assert topics(node) == COMMON


def test_with_objreg_msgs_all_that_is_known_is_announced_under_the_name_of_the_namespace(node: Node) -> None:
    if closures_msg.LoopClosureMsg is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    announcements = Announcements(node)
    assert topics(node) == COMMON | WHOLE
    refusals = received(node, closures_msg.Refusal, "closure_refusals", qos.stage())
    landmarks = received(node, closures_msg.ObjectLandmarks, "object_landmarks", qos.stage())
    announcements.closures([CLOSURE])
    closures = received(node, closures_msg.LoopClosureMsg, "loop_closures", qos.latched())  # it comes late
    deadline = time.monotonic() + 60.0
    while node.count_subscribers("closure_refusals") == 0 and time.monotonic() < deadline:
        time.sleep(0.05)
    announcements.refusals([REJECTED])
    announcements.landmarks(SEEN, 9, "kinect", {0: "cup"}, 1)
    wait_for(node, closures, refusals, landmarks)
    assert closures[0].id == closures_msg.closure_id(CLOSURE, "fleet/robot1")
    assert closures[0].to_moment.robot == refusals[0].to_moment.robot == landmarks[0].robot == "fleet/robot1"
    assert refusals[0].reason == refusals[0].NO_CANDIDATE and landmarks[0].landmarks[0].id == 4


def test_the_state_of_the_localisation_goes_out_where_it_changes_and_once_a_second(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(localisation_msg, "LocalisationStateMsg", None)
    state = LocalisationState(
        stamp_ns=0, state=State.TRACKING, reason="", age_s=0.0, odds=1.0, probability=0.5, sigma_m=0.1
    )
    asked = [state]
    announcements = LocalisationAnnouncements(node, lambda: asked[-1])
    sent: list[int] = []
    monkeypatch.setattr(announcements, "_publisher", SimpleNamespace(publish=sent.append))
    monkeypatch.setattr(localisation_msg, "localisation_state", lambda now, *where: (now.state, *where))
    for stamp_ns in (0, 400_000_000, 999_999_999, 1_000_000_000, 1_500_000_000):
        announcements.passed(stamp_ns, "eye")
    assert sent == 2 * [(State.TRACKING, "eye", "fleet/robot1")]
    announcements.look()
    assert len(sent) == 2
    asked.append(replace(state, state=State.LOST))
    announcements.look()
    assert sent[-1] == (State.LOST, "eye", "fleet/robot1") and announcements.now == asked[-1]
