# SPDX-License-Identifier: Apache-2.0
"""What becomes of the messages of a graph; they are handed to the subscriptions, without any graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import Image

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.messages.markers import MarkerScene
from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import CommonDiagnostics
from objreg_ros.bridge.node.diagnostics import acceptances, diagnostic, refusals
from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame, View
from objreg_ros.data.images import Detections, Intrinsics
from objreg_tools.cli.watching.topics import watch
from objreg_tools.cli.watching.watched import Watched

CLOSURE = LoopClosure(
    from_ns=5, to_ns=9, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), evidence={"odds": 7.0}
)
REFUSED = Rejected(reason=Reason.NO_CANDIDATE, from_ns=9, to_ns=9, detail="none of 3")
COUNTERS = Balance(10, 6, 1, {"overtaken": 3}, {}, {"total": (10.0, 20.0)})


@pytest.fixture
def watched() -> Watched:
    return Watched()


@pytest.fixture
def node(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    context.init(args=[])
    made = watch(context, watched, ["-r", "__ns:=/robot1", "-r", "image:=/camera/rgb"])
    yield made
    made.destroy_node()
    context.try_shutdown()


def frame(stamp_ns: int) -> Frame:
    """One without objects."""
    camera = Intrinsics(fx=5.0, fy=5.0, cx=5.0, cy=4.0, width=10, height=8)
    view = View(xyz=np.ones((8, 10, 3), np.float32), grey=None, intrinsics=camera)
    return Frame(
        objects=(), support=None, view=view, gravity=None, gravity_confidence=0.0, T_odom_camera=None,
        stamp_ns=stamp_ns,
    )  # fmt: skip


def give(node: Node, topic: str, message: Any) -> None:
    """Hand a message to the subscription of a topic, as ROS does."""
    (subscription,) = (s for s in node.subscriptions if s.topic_name == topic)
    assert isinstance(message, subscription.msg_type)
    subscription.callback(message)


def test_it_listens_to_the_robots_topics_and_to_what_is_remapped(node: Node) -> None:
    names = {subscription.topic_name for subscription in node.subscriptions}
    assert {"/diagnostics", "/robot1/refusals", "/robot1/markers", "/camera/rgb"} <= names


def test_results_are_taken_in(node: Node, watched: Watched) -> None:
    give(node, "/diagnostics", diagnostic("/robot1/registrar", Time(), ["late"], CommonDiagnostics.of(COUNTERS, 3.0)))
    give(node, "/robot1/acceptances", acceptances("/registrar", Time(), [CLOSURE]))
    give(node, "/robot1/refusals", refusals("/registrar", Time(), [REFUSED]))
    state = watched.as_json()
    assert state["nodes"][0]["name"] == "/robot1/registrar" and state["nodes"][0]["warns"]
    assert state["closures"][0]["labels"] == "cup" and state["closures"][0]["odds"] == 7.0
    assert state["refusals"][0]["detail"] == "none of 3"


def test_the_trajectory_grows_and_markers_are_drawn(node: Node, watched: Watched) -> None:
    for x in (1.0, 2.0):
        message = Odometry()
        message.pose.pose.position.x = x
        give(node, "/robot1/odom", message)
    give(node, "/robot1/path", Path(poses=[PoseStamped(), PoseStamped()]))
    give(node, "/robot1/markers", MarkerScene().markers([(4, "cup", np.array([1.0, 2.0, 3.0]))], 9, "odom"))
    state = watched.as_json()
    assert state["odometry"] == [[1.0, 0.0], [2.0, 0.0]] and state["corrected"] == [[0.0, 0.0]] * 2
    assert state["objects"] == [["cup 4", 1.0, 2.0]] and state["edges"] == {"accepted": [], "rejected": []}


def test_a_picture_is_shown_with_what_was_found_in_it_at_its_time(node: Node, watched: Watched) -> None:
    names = {0: "cup"}
    found = Detections(
        xyxy=np.array([[1, 2, 9, 7]], np.float32), score=np.array([0.5], np.float32), label=("cup",), image_hw=(8, 10),
        stamp_ns=7_000_000_000,
    )  # fmt: skip
    image = Image(height=8, width=10, encoding="rgb8", step=30, data=bytes(240))
    image.header.stamp = Time(sec=7)
    give(node, "/robot1/labels", to_msg.labels(names))
    give(node, "/camera/rgb", image)
    give(node, "/robot1/detections_table", to_msg.detections_table(found, names))
    give(node, "/robot1/objects", to_msg.objects(frame(7_000_000_000), names))
    assert watched.as_json()["picture"] == "7000000000" and watched.picture() is not None


def test_a_message_that_breaks_its_contract_is_passed_over(node: Node, watched: Watched) -> None:
    broken = Odometry()
    broken.pose.pose.position.x = float("nan")
    give(node, "/robot1/odom", broken)
    give(node, "/robot1/acceptances", DiagnosticArray(status=[DiagnosticStatus(name="x")]))
    assert watched.as_json()["odometry"] == [] and watched.as_json()["closures"] == []
