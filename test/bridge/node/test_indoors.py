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
from objreg_ros.bridge.node.door import Door
from objreg_ros.bridge.node.indoors import Indoors

STEPS = 200


class House:
    """A door that speaks and one that listens, in one executor."""

    def __init__(self) -> None:
        self.indoors = Indoors()
        self.speaker, self.listener = (Door(name, indoors=self.indoors) for name in ("speaker", "listener"))
        self.outlet = self.speaker.offer(String, "word", qos.room())
        self.written: list[Any] = []
        self.heard: list[Any] = []
        self.executor = SingleThreadedExecutor()
        for door in self.doors:
            self.executor.add_node(door)

    @property
    def doors(self) -> tuple[Door, Door]:
        return self.speaker, self.listener

    def tell(self, word: object) -> None:
        self.outlet.tell(word, lambda: self.write(word))

    def write(self, word: object) -> String:
        self.written.append(word)
        return String(data=str(word))

    def spin_until(self, true: Callable[[], bool]) -> bool:
        return any(true() or self.executor.spin_once(timeout_sec=0.05) for _ in range(STEPS))

    def close(self) -> None:
        for door in self.doors:
            door.close()
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
        String, "word", lambda word: (house.heard.append(word), threads.add(threading.get_ident())), qos.room()
    )
    told = [object() for _ in range(50)]
    teller = threading.Thread(target=lambda: [house.tell(word) for word in told])
    teller.start()
    teller.join()
    assert house.heard == []
    assert house.spin_until(lambda: len(house.heard) == 50)
    assert house.heard == told and threads == {threading.get_ident()} and house.written == []
    assert house.listener.connected == {"/word": 1}


def test_a_message_is_written_where_somebody_listens_outside(house: House) -> None:
    other = rclpy.create_node("other")
    house.executor.add_node(other)
    other.create_subscription(String, "word", house.heard.append, qos.room())
    assert house.spin_until(lambda: house.speaker.count_subscribers("/word") == 1)
    assert house.spin_until(lambda: bool(house.heard) or bool(house.tell(7)))
    assert house.heard[0].data == "7"
    other.destroy_node()


def test_a_word_that_breaks_its_contract_is_counted_and_the_next_one_heard(house: House) -> None:
    def hear(word: object) -> None:
        if word == "bad":
            raise ValueError("expected better")
        house.heard.append(word)

    house.listener.listen(String, "word", hear, qos.room())
    house.tell("bad")
    house.tell("good")
    assert house.spin_until(lambda: house.heard == ["good"])
    assert house.listener._ignored == {"malformed word": 1}


def test_a_topic_that_was_closed_is_heard_no_more(house: House) -> None:
    def decode(_: str, word: Any) -> None:
        if word == "bad":
            raise ValueError("expected better")

    house.listener.listen_to_first(
        "words", {"word": String, "other": String}, decode, lambda _, word: house.heard.append(word), qos.room()
    )
    house.tell("good")
    assert house.spin_until(lambda: house.heard == ["good"]) and house.listener.taken("words") == "word"
    house.listener.hang_up("words")
    house.tell("more")
    for _ in range(5):
        house.executor.spin_once(timeout_sec=0.01)
    assert house.heard == ["good"] and house.listener.connected == {}


def test_a_topic_that_nobody_offers_here_is_subscribed_to(house: House) -> None:
    subscription = house.listener.listen(String, "far", house.heard.append, qos.room())
    assert house.listener.count_subscribers("/far") == 1 and subscription.topic_name == "/far"


def test_who_passes_a_topic_on_hears_it_from_outside_also_when_it_is_opened_again_after_a_silence(house: House) -> None:
    door, topics = house.speaker, {"raw": String, "packed": String}
    for topic in topics:
        door.pass_on(topic)
    told = lambda _, message: house.heard.append(message.data)  # noqa: E731
    door.listen_to_first("words", topics, lambda *_: None, told, qos.room())
    senders = {topic: house.listener.create_publisher(String, topic, qos.room()) for topic in topics}
    assert house.spin_until(lambda: door.count_publishers("/raw") == 1 and door.count_publishers("/packed") == 1)
    assert house.spin_until(lambda: "a" in house.heard or bool(senders["raw"].publish(String(data="a"))))
    assert door.taken("words") == "raw"
    door._choices["words"]._silence_s = 0.0
    door._choices["words"].look()
    assert house.spin_until(lambda: "b" in house.heard or bool(senders["packed"].publish(String(data="b"))))
    assert house.indoors.offers("/raw") and house.indoors.offers("/packed")
