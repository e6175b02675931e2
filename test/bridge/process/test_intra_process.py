# SPDX-License-Identifier: Apache-2.0
"""Values between the nodes of one process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.process.intra_process import IntraProcessBus

STEPS = 200


class NodePair:
    """A node that speaks and one that listens, in one executor."""

    def __init__(self) -> None:
        self.bus = IntraProcessBus()
        self.speaker, self.listener = (NodeBase(name, bus=self.bus) for name in ("speaker", "listener"))
        self.publisher = self.speaker.offer(String, "text", qos.stage())
        self.written: list[Any] = []
        self.received: list[Any] = []
        self.executor = SingleThreadedExecutor()
        for node in self.nodes:
            self.executor.add_node(node)

    @property
    def nodes(self) -> tuple[NodeBase, NodeBase]:
        return self.speaker, self.listener

    def publish(self, value: object) -> None:
        self.publisher.publish(value, lambda: self.write(value))

    def write(self, value: object) -> String:
        self.written.append(value)
        return String(data=str(value))

    def spin_until(self, true: Callable[[], bool]) -> bool:
        return any(true() or self.executor.spin_once(timeout_sec=0.05) for _ in range(STEPS))

    def close(self) -> None:
        for node in self.nodes:
            node.close()
        self.executor.shutdown()


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[NodePair]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=[])
    made = NodePair()
    yield made
    made.close()
    rclpy.try_shutdown()


def test_values_come_by_the_executor_in_order_and_no_message_is_written(pair: NodePair) -> None:
    threads = set[int]()
    pair.listener.listen(
        String,
        "text",
        lambda value: (pair.received.append(value), threads.add(threading.get_ident())),
        qos.stage(),
    )
    values = [object() for _ in range(50)]
    sender = threading.Thread(target=lambda: [pair.publish(value) for value in values])
    sender.start()
    sender.join()
    assert pair.received == []
    assert pair.spin_until(lambda: len(pair.received) == 50)
    assert pair.received == values and threads == {threading.get_ident()} and pair.written == []
    assert pair.listener.connected == {"/text": 1}


def test_a_message_is_written_where_somebody_listens_outside(pair: NodePair) -> None:
    other = rclpy.create_node("other")
    pair.executor.add_node(other)
    other.create_subscription(String, "text", pair.received.append, qos.stage())
    assert pair.spin_until(lambda: pair.speaker.count_subscribers("/text") == 1)
    assert pair.spin_until(lambda: bool(pair.received) or bool(pair.publish(7)))
    assert pair.received[0].data == "7"
    other.destroy_node()


def test_a_value_that_breaks_its_contract_is_counted_and_the_next_one_received(pair: NodePair) -> None:
    def receive(value: object) -> None:
        if value == "bad":
            raise ValueError("expected better")
        pair.received.append(value)

    pair.listener.listen(String, "text", receive, qos.stage())
    pair.publish("bad")
    pair.publish("good")
    assert pair.spin_until(lambda: pair.received == ["good"])
    assert pair.listener._ignored == {"malformed text": 1}


def test_a_topic_that_was_closed_is_received_no_longer(pair: NodePair) -> None:
    def decode(_: str, value: Any) -> None:
        if value == "bad":
            raise ValueError("expected better")

    pair.listener.listen_to_first(
        "texts",
        {"text": String, "other": String},
        decode,
        lambda _, value: pair.received.append(value),
        qos.stage(),
    )
    pair.publish("good")
    assert pair.spin_until(lambda: pair.received == ["good"]) and pair.listener.taken("texts") == "text"
    pair.listener.hang_up("texts")
    pair.publish("more")
    for _ in range(5):
        pair.executor.spin_once(timeout_sec=0.01)
    assert pair.received == ["good"] and pair.listener.connected == {}


def test_a_topic_that_nobody_offers_here_is_subscribed_to(pair: NodePair) -> None:
    subscription = pair.listener.listen(String, "far", pair.received.append, qos.stage())
    assert pair.listener.count_subscribers("/far") == 1 and subscription.topic_name == "/far"


def test_who_passes_a_topic_on_receives_it_from_outside_also_when_it_is_opened_again_after_a_silence(
    pair: NodePair,
) -> None:
    node, topics = pair.speaker, {"raw": String, "packed": String}
    for topic in topics:
        node.pass_on(topic)
    receive = lambda _, message: pair.received.append(message.data)  # noqa: E731
    node.listen_to_first("texts", topics, lambda *_: None, receive, qos.stage())
    senders = {topic: pair.listener.create_publisher(String, topic, qos.stage()) for topic in topics}
    assert pair.spin_until(lambda: node.count_publishers("/raw") == 1 and node.count_publishers("/packed") == 1)
    assert pair.spin_until(lambda: "a" in pair.received or bool(senders["raw"].publish(String(data="a"))))
    assert node.taken("texts") == "raw"
    node._choices["texts"]._silence_s = 0.0
    node._choices["texts"].look()
    assert pair.spin_until(lambda: "b" in pair.received or bool(senders["packed"].publish(String(data="b"))))
    assert pair.bus.offers("/raw") and pair.bus.offers("/packed")
