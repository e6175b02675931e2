# SPDX-License-Identifier: Apache-2.0
"""Words between the nodes of one process."""

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


class House:
    """A node that speaks and one that listens, in one executor."""

    def __init__(self) -> None:
        self.bus = IntraProcessBus()
        self.speaker, self.listener = (NodeBase(name, bus=self.bus) for name in ("speaker", "listener"))
        self.outlet = self.speaker.offer(String, "word", qos.stage())
        self.written: list[Any] = []
        self.received: list[Any] = []
        self.executor = SingleThreadedExecutor()
        for node in self.nodes:
            self.executor.add_node(node)

    @property
    def nodes(self) -> tuple[NodeBase, NodeBase]:
        return self.speaker, self.listener

    def publish(self, word: object) -> None:
        self.outlet.publish(word, lambda: self.write(word))

    def write(self, word: object) -> String:
        self.written.append(word)
        return String(data=str(word))

    def spin_until(self, true: Callable[[], bool]) -> bool:
        return any(true() or self.executor.spin_once(timeout_sec=0.05) for _ in range(STEPS))

    def close(self) -> None:
        for node in self.nodes:
            node.close()
        self.executor.shutdown()


@pytest.fixture
def house(monkeypatch: pytest.MonkeyPatch) -> Iterator[House]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=[])
    made = House()
    yield made
    made.close()
    rclpy.try_shutdown()


def test_words_come_by_the_executor_in_order_and_no_message_is_written(house: House) -> None:
    threads = set[int]()
    house.listener.listen(
        String, "word", lambda word: (house.received.append(word), threads.add(threading.get_ident())), qos.stage()
    )
    told = [object() for _ in range(50)]
    teller = threading.Thread(target=lambda: [house.publish(word) for word in told])
    teller.start()
    teller.join()
    assert house.received == []
    assert house.spin_until(lambda: len(house.received) == 50)
    assert house.received == told and threads == {threading.get_ident()} and house.written == []
    assert house.listener.connected == {"/word": 1}


def test_a_message_is_written_where_somebody_listens_outside(house: House) -> None:
    other = rclpy.create_node("other")
    house.executor.add_node(other)
    other.create_subscription(String, "word", house.received.append, qos.stage())
    assert house.spin_until(lambda: house.speaker.count_subscribers("/word") == 1)
    assert house.spin_until(lambda: bool(house.received) or bool(house.publish(7)))
    assert house.received[0].data == "7"
    other.destroy_node()


def test_a_word_that_breaks_its_contract_is_counted_and_the_next_one_heard(house: House) -> None:
    def receive(word: object) -> None:
        if word == "bad":
            raise ValueError("expected better")
        house.received.append(word)

    house.listener.listen(String, "word", receive, qos.stage())
    house.publish("bad")
    house.publish("good")
    assert house.spin_until(lambda: house.received == ["good"])
    assert house.listener._ignored == {"malformed word": 1}


def test_a_topic_that_was_closed_is_heard_no_more(house: House) -> None:
    def decode(_: str, word: Any) -> None:
        if word == "bad":
            raise ValueError("expected better")

    house.listener.listen_to_first(
        "words", {"word": String, "other": String}, decode, lambda _, word: house.received.append(word), qos.stage()
    )
    house.publish("good")
    assert house.spin_until(lambda: house.received == ["good"]) and house.listener.taken("words") == "word"
    house.listener.hang_up("words")
    house.publish("more")
    for _ in range(5):
        house.executor.spin_once(timeout_sec=0.01)
    assert house.received == ["good"] and house.listener.connected == {}


def test_a_topic_that_nobody_offers_here_is_subscribed_to(house: House) -> None:
    subscription = house.listener.listen(String, "far", house.received.append, qos.stage())
    assert house.listener.count_subscribers("/far") == 1 and subscription.topic_name == "/far"


def test_who_passes_a_topic_on_hears_it_from_outside_also_when_it_is_opened_again_after_a_silence(house: House) -> None:
    node, topics = house.speaker, {"raw": String, "packed": String}
    for topic in topics:
        node.pass_on(topic)
    told = lambda _, message: house.received.append(message.data)  # noqa: E731
    node.listen_to_first("words", topics, lambda *_: None, told, qos.stage())
    senders = {topic: house.listener.create_publisher(String, topic, qos.stage()) for topic in topics}
    assert house.spin_until(lambda: node.count_publishers("/raw") == 1 and node.count_publishers("/packed") == 1)
    assert house.spin_until(lambda: "a" in house.received or bool(senders["raw"].publish(String(data="a"))))
    assert node.taken("words") == "raw"
    node._choices["words"]._silence_s = 0.0
    node._choices["words"].look()
    assert house.spin_until(lambda: "b" in house.received or bool(senders["packed"].publish(String(data="b"))))
    assert house.bus.offers("/raw") and house.bus.offers("/packed")
