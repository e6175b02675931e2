# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from std_msgs.msg import String
from std_srvs.srv import Trigger

from objreg_ros.bridge import qos
from objreg_ros.bridge.door import Door, DroppedError


@pytest.fixture
def door() -> Iterator[Door]:
    rclpy.init(args=[])
    made = Door("door")
    yield made
    made.close()
    rclpy.try_shutdown()


def spin_until(door: Door, heard: list[Any], count: int) -> None:
    for _ in range(400):
        if len(heard) >= count:
            return
        rclpy.spin_once(door, timeout_sec=0.05)


def refuse(message: Any) -> None:
    raise ValueError(f"expected better than {message!r}")


def test_a_message_that_breaks_its_contract_is_dropped_by_the_name_of_its_topic(door: Door) -> None:
    with pytest.raises(DroppedError, match="expected better than 'x'") as dropped:
        door.read("image", refuse, "x")
    assert dropped.value.reason == "malformed_image"


@pytest.mark.parametrize("error", [ValueError("too far"), OSError("the disk is full")])
def test_what_breaks_on_one_frame_is_counted_and_the_node_lives(door: Door, error: Exception) -> None:
    def work() -> bool:
        raise error

    door.accept(5)
    door.conclude(5, work)
    assert door.ledger.balance().dropped == {"refused": 1} and not door.failure.done()


def test_a_message_aside_that_breaks_its_contract_is_nothing(door: Door) -> None:
    assert door.read_aside("labels", refuse, "x") is None
    assert door.read_aside("labels", str.upper, "x") == "X"


def test_of_topics_that_carry_the_same_the_first_that_speaks_is_kept_and_the_others_are_closed(door: Door) -> None:
    heard: list[tuple[str, str]] = []
    door.listen_to_first(
        "words", {"quiet": String, "loud": String}, lambda topic, m: heard.append((topic, m.data)), qos.room()
    )
    loud, quiet = (door.create_publisher(String, topic, qos.room()) for topic in ("loud", "quiet"))
    spin_until(door, [] if loud.get_subscription_count() == 0 else [1], 1)
    loud.publish(String(data="one"))
    spin_until(door, heard, 1)
    assert heard == [("loud", "one")]
    assert door.count_subscribers("/quiet") == 0 and door.count_subscribers("/loud") == 1
    quiet.publish(String(data="two"))
    loud.publish(String(data="three"))
    spin_until(door, heard, 2)
    assert heard[1:] == [("loud", "three")]


def test_an_input_that_is_hung_up_has_no_subscriptions_and_hears_nothing_more(door: Door) -> None:
    door.listen_to_first("words", {"quiet": String, "loud": String}, lambda *_: None, qos.room())
    assert door.count_subscribers("/quiet") == door.count_subscribers("/loud") == 1
    door.hang_up("words")
    door.hang_up("never opened")
    assert door.count_subscribers("/quiet") == door.count_subscribers("/loud") == 0


@pytest.mark.parametrize(("publishers", "lost"), [(1, {"word": 3}), (2, {})])
def test_what_the_transport_lost_is_counted_where_one_publisher_numbered_it(
    door: Door, publishers: int, lost: dict[str, int]
) -> None:
    door.count_publishers = {"/word": publishers}.__getitem__  # type: ignore[method-assign]
    for count in (3, 0):
        door._note_loss("word", count)
    assert door.ledger.balance().lost == lost


def test_the_rate_is_of_what_came_since_the_last_report(door: Door) -> None:
    told: list[Any] = []
    door._diagnostics.publish = told.append  # type: ignore[method-assign]
    for since, frames in ((4.0, range(8)), (2.0, range(8, 11))):
        door._last = (time.monotonic() - since, door._last[1])
        for stamp_ns in frames:
            door.accept(stamp_ns)
        door._report()
    rates = [float(value.value) for array in told for value in array.status[0].values if value.key == "rate [Hz]"]
    assert rates == pytest.approx([2.0, 1.5], rel=0.1)


def test_while_a_service_waits_for_work_aside_the_node_hears_on(door: Door) -> None:
    heard: list[str] = []
    go = threading.Event()

    async def answer(_: Any, response: Any) -> Any:
        response.success = await door.aside(lambda: go.wait(20.0))
        return response

    def hear(message: Any) -> None:
        heard.append(message.data)
        go.set()

    door.create_service(Trigger, "save", answer, callback_group=door.apart)
    door.listen(String, "word", hear, qos.room())
    client, word = door.create_client(Trigger, "save"), door.create_publisher(String, "word", qos.room())
    spin_until(door, [] if word.get_subscription_count() == 0 else [1], 1)
    asked = client.call_async(Trigger.Request())
    for _ in range(5):
        rclpy.spin_once(door, timeout_sec=0.05)
    assert not asked.done()
    word.publish(String(data="one"))
    deadline = time.monotonic() + 20.0
    while not asked.done() and time.monotonic() < deadline:
        rclpy.spin_once(door, timeout_sec=0.05)
    assert heard == ["one"] and asked.result().success


def test_what_is_done_aside_is_over_before_a_node_ends(door: Door) -> None:
    done: list[str] = []
    go = threading.Event()
    door.aside(lambda: (go.wait(20.0), done.append("stored")))
    threading.Timer(0.1, go.set).start()
    door.end_aside()
    assert done == ["stored"]
