# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.overridable import FIXED

Made = Callable[..., NodeBase]


@pytest.fixture
def made() -> Iterator[Made]:
    nodes: list[NodeBase] = []

    def make(*arguments: str) -> NodeBase:
        rclpy.init(args=["--ros-args", *(word for given in arguments for word in given.split(" ", 1))])
        nodes.append(NodeBase("node"))
        return nodes[-1]

    yield make
    for node in nodes:
        node.close()
    rclpy.try_shutdown()


def received_with(node: NodeBase, topic: str) -> QoSProfile:
    """The QoS with which a topic is listened to, as every other node sees it."""
    (info,) = node.get_subscriptions_info_by_topic(topic)
    return info.qos_profile


def sent_with(node: NodeBase, topic: str) -> QoSProfile:
    (info,) = node.get_publishers_info_by_topic(topic)
    return info.qos_profile


def test_a_subscription_is_as_reliable_as_its_override_says(made: Made) -> None:
    node = made("-p qos_overrides./image.subscription.reliability:=reliable")
    node.listen(String, "image", print, qos.sensor(False))
    assert received_with(node, "/image").reliability == qos.stage().reliability


def test_a_publisher_is_as_reliable_as_its_override_says(made: Made) -> None:
    node = made("-p qos_overrides./text.publisher.reliability:=best_effort")
    node.create_publisher(String, "text", qos.stage())
    assert sent_with(node, "/text").reliability == qos.sensor(False).reliability


def test_without_an_override_a_topic_is_as_it_was_asked_for_and_its_parameters_say_so(made: Made) -> None:
    node = made()
    node.listen(String, "image", print, qos.sensor(False, depth=7))
    assert received_with(node, "/image").reliability == qos.sensor(False).reliability
    start = "qos_overrides./image.subscription."
    found = {name: node.get_parameter(start + name).value for name in ("history", "depth", "reliability")}
    assert found == {"history": "keep_last", "depth": 7, "reliability": "best_effort"}
    assert node.describe_parameter(f"{start}depth").read_only


def test_an_override_is_of_the_full_name_after_remapping_in_a_file_too(made: Made, tmp_path: Path) -> None:
    file = tmp_path / "params.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    qos_overrides:\n      /robot/eye:\n"
        "        subscription: {reliability: reliable, depth: 3}\n"
    )
    node = made(f"--params-file {file}", "-r __ns:=/robot", "-r image:=eye")
    node.listen(String, "image", print, qos.sensor(False))
    assert received_with(node, "/robot/eye").reliability == qos.stage().reliability
    assert node.get_parameter("qos_overrides./robot/eye.subscription.depth").value == 3


def test_of_topics_that_are_opened_together_an_override_changes_one(made: Made) -> None:
    node = made("-p qos_overrides./image.subscription.reliability:=reliable")
    profile = qos.sensor(False)
    node.listen_to_first("image", {"image": String, "image/compressed": String}, print, print, profile)
    assert received_with(node, "/image").reliability == qos.stage().reliability
    assert received_with(node, "/image/compressed").reliability == qos.sensor(False).reliability
    assert profile == qos.sensor(False)


def test_a_topic_that_is_opened_again_has_the_same_override(made: Made) -> None:
    node = made("-p qos_overrides./image.subscription.reliability:=reliable")
    for _ in range(2):
        node.listen_to_first("image", {"image": String}, print, print, qos.sensor(False))
        assert received_with(node, "/image").reliability == qos.stage().reliability
        node.hang_up("image")


def test_a_second_subscription_with_a_qos_of_its_own_is_left_as_it_is(made: Made) -> None:
    node = made("-p qos_overrides./text.subscription.reliability:=best_effort")
    node.create_subscription(String, "text", print, qos.latched(), qos_overriding_options=FIXED)
    assert received_with(node, "/text").reliability == qos.latched().reliability


def test_the_clock_may_be_overridden_as_in_rclcpp(made: Made) -> None:
    node = made("-p use_sim_time:=true", "-p qos_overrides./clock.subscription.reliability:=reliable")
    assert received_with(node, "/clock").reliability == qos.stage().reliability


@pytest.mark.parametrize(
    ("override", "got"),
    [
        ("reliability:=best", "`best`"),
        ("reliability:=unknown", "unknown"),
        ("reliability:=3", "'3'"),
        ("history:=unknown", "unknown"),
        ("depth:=many", "'many'"),
        ("depth:=-3", "-3"),
    ],
)
def test_an_override_that_is_no_qos_is_refused_in_one_line(made: Made, override: str, got: str) -> None:
    node = made(f"-p qos_overrides./image.subscription.{override}")
    with pytest.raises(ValueError, match="qos_overrides of image") as refused:
        node.listen(String, "image", print, qos.sensor(False))
    assert got in str(refused.value) and "\n" not in str(refused.value)


def test_once_ros_is_shut_down_a_publisher_has_no_reader_and_publishes_nothing(made: Made) -> None:
    node = made()
    sent = node.create_publisher(String, "texts", qos.stage())
    sent.publish(String(data="before"))
    rclpy.shutdown()
    sent.publish(String(data="after"))
    assert sent.get_subscription_count() == 0


def test_what_is_no_message_is_refused_as_ever(made: Made) -> None:
    with pytest.raises(TypeError):
        made().create_publisher(String, "texts", qos.stage()).publish("no message")  # type: ignore[arg-type]
