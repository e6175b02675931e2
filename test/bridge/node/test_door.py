# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import String
from std_srvs.srv import Trigger

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.door import REST, Door, DroppedError
from objreg_ros.bridge.node.drops import Drops
from objreg_ros.bridge.node.log import ThrottledLog


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


WORDS = {"quiet": String, "loud": String}


def decode(_: str, message: Any) -> str:
    if message.data == "bug":
        raise IndexError("nobody expected this")
    if message.data == "junk":
        raise ValueError("expected a word, got junk")
    return message.data


class AbsurdError(Exception):
    """What no decoder should raise."""


def stumble(message: Any) -> None:
    raise AbsurdError("nobody expected this")


@pytest.fixture
def said(door: Door) -> list[str]:
    """What the log of the door is told, warnings and errors."""
    lines: list[str] = []
    door.throttled = ThrottledLog(lines.append)
    door.get_logger = lambda: SimpleNamespace(error=lines.append)  # type: ignore[method-assign]
    return lines


def test_a_message_that_breaks_its_contract_is_dropped_by_the_name_of_its_topic(door: Door) -> None:
    with pytest.raises(DroppedError, match="expected better than 'x'") as dropped:
        door.read("image", refuse, "x")
    assert dropped.value.reason == "malformed_image"


def test_what_no_decoder_should_raise_drops_the_message_by_the_name_of_the_exception(
    door: Door, said: list[str]
) -> None:
    for _ in range(3):
        with pytest.raises(DroppedError, match="nobody expected this") as dropped:
            door.read("image", stumble, "x")
        assert dropped.value.reason == "malformed_image (AbsurdError)"
        assert door.read_aside("labels", stumble, "x") is None
    assert door._ignored == {"malformed labels (AbsurdError)": 3}
    bugs = [line for line in said if "please report it" in line]
    assert len(bugs) == 2 and all("Traceback" in line and "def stumble" not in line for line in bugs)


def test_a_bug_in_the_work_on_a_frame_is_counted_by_its_name_told_once_and_the_node_lives(
    door: Door, said: list[str]
) -> None:
    for stamp_ns in (5, 6):
        door.accept(stamp_ns)
        door.conclude(stamp_ns, lambda: stumble(None) is None)
    assert door.ledger.balance().dropped == {"bug (AbsurdError)": 2} and not door.failure.done()
    assert len([line for line in said if "please report it" in line]) == 1


@pytest.mark.parametrize(
    ("error", "counted"),
    [(ValueError("a stamp"), "malformed word"), (SystemError("a bug"), "malformed word (SystemError)")],
)
def test_a_message_that_breaks_where_it_is_heard_is_counted_and_the_next_one_is_heard(
    door: Door, error: Exception, counted: str
) -> None:
    heard: list[str] = []

    def hear(message: Any) -> None:
        if message.data == "bad":
            raise error
        heard.append(message.data)

    door.listen(String, "word", hear, qos.room())
    word = door.create_publisher(String, "word", qos.room())
    spin_until(door, [] if word.get_subscription_count() == 0 else [1], 1)
    for data in ("bad", "good"):
        word.publish(String(data=data))
    spin_until(door, heard, 1)
    assert heard == ["good"] and door._ignored == {counted: 1}


@pytest.mark.parametrize("error", [ValueError("too far"), OSError("the disk is full")])
def test_what_breaks_on_one_frame_is_counted_and_the_node_lives(door: Door, error: Exception) -> None:
    def work() -> bool:
        raise error

    door.accept(5)
    door.conclude(5, work)
    assert door.ledger.balance().dropped == {"refused": 1} and not door.failure.done()


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def told(door: Door, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], DiagnosticStatus]:
    """The status that a door reports at a time by the clock of its drops."""
    clock = Clock()
    door._drops = Drops(period_s=5.0, clock=clock)
    told: list[Any] = []
    monkeypatch.setattr(door._diagnostics, "publish", told.append)

    def report(now: float) -> DiagnosticStatus:
        clock.now = now
        door._report()
        return told[-1].status[0]

    return report


def test_thirty_of_thirty_malformed_frames_are_a_warning_with_the_reason(
    door: Door, told: Callable[[float], DiagnosticStatus]
) -> None:
    for stamp_ns in range(30):
        told(stamp_ns * 0.2)
        door.accept(stamp_ns)
        door.conclude(stamp_ns, lambda: bool(door.read("image", refuse, "x")))
    warned = told(6.0)
    assert warned.level == DiagnosticStatus.WARN
    assert "30 as malformed image (expected better than 'x')" in warned.message
    door.accept(30)
    door.conclude(30, lambda: True)
    assert told(17.0).level == DiagnosticStatus.OK


def test_an_input_beside_the_frames_of_which_everything_is_malformed_is_a_warning(
    door: Door, told: Callable[[float], DiagnosticStatus]
) -> None:
    for second in range(7):
        told(second)
        door.read_aside("odom", refuse, "x")
        door.read_aside("labels", refuse if second else str.upper, "x")
    assert told(6.0).message.startswith("odom: everything was dropped for 6 s, 7 as malformed")
    door.read_aside("odom", str.upper, "x")
    door.read_aside("labels", str.upper, "x")
    assert told(17.0).level == DiagnosticStatus.OK


def test_frames_that_newer_ones_overtake_are_no_trouble_where_some_get_through(
    door: Door, told: Callable[[float], DiagnosticStatus]
) -> None:
    for stamp_ns in range(100):
        told(stamp_ns * 0.2)
        door.accept(stamp_ns)
        if stamp_ns % 20 == 0:
            door.conclude(stamp_ns, lambda: True)
        else:
            door._overtaken((stamp_ns, None))
        assert told(stamp_ns * 0.2).level == DiagnosticStatus.OK


def test_a_message_aside_that_breaks_its_contract_is_nothing(door: Door) -> None:
    assert door.read_aside("labels", refuse, "x") is None
    assert door.read_aside("labels", str.upper, "x") == "X"


def test_of_topics_that_carry_the_same_the_first_that_speaks_is_kept_and_the_others_are_closed(door: Door) -> None:
    heard: list[tuple[str, str]] = []
    door.listen_to_first("words", WORDS, decode, lambda topic, m: heard.append((topic, m.data)), qos.room())
    loud, quiet = (door.create_publisher(String, topic, qos.room()) for topic in ("loud", "quiet"))
    spin_until(door, [] if loud.get_subscription_count() == 0 else [1], 1)
    loud.publish(String(data="one"))
    spin_until(door, heard, 1)
    assert heard == [("loud", "one")]
    assert door.count_subscribers("/quiet") == 0 and door.count_subscribers("/loud") == 1
    quiet.publish(String(data="two"))
    loud.publish(String(data="three"))
    spin_until(door, heard, 2)
    assert heard[1:] == [("loud", "three")] and door.taken("words") == "loud"


def test_a_message_that_does_not_decode_closes_no_topic(door: Door) -> None:
    heard: list[str] = []
    door.listen_to_first("words", WORDS, decode, lambda topic, m: heard.append(m.data), qos.room())
    loud, quiet = (door.create_publisher(String, topic, qos.room()) for topic in ("loud", "quiet"))
    spin_until(door, [] if quiet.get_subscription_count() == 0 else [1], 1)
    for publisher, word in ((loud, "junk"), (loud, "bug"), (quiet, "one")):
        publisher.publish(String(data=word))
        spin_until(door, heard, len(heard) + 1)
    assert heard == ["junk", "bug", "one"] and door.taken("words") == "quiet"
    assert door.count_subscribers("/loud") == 0


def test_the_other_topics_are_opened_again_once_the_one_that_was_taken_is_silent(door: Door) -> None:
    door.listen_to_first("words", WORDS, decode, lambda *_: None, qos.room())
    choice = door._choices["words"]
    choice.hear("loud", String(data="one"))
    assert door.count_subscribers("/quiet") == 0
    choice._clock = lambda: time.monotonic() + 5.0
    door._report()
    assert door.taken("words") is None
    assert door.count_subscribers("/quiet") == door.count_subscribers("/loud") == 1


def test_an_input_that_is_hung_up_has_no_subscriptions_and_hears_nothing_more(door: Door) -> None:
    door.listen_to_first("words", WORDS, decode, lambda *_: None, qos.room())
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


def test_whoever_calls_a_service_all_the_time_is_refused_for_most_of_it(door: Door) -> None:
    worked: list[float] = []

    def work() -> tuple[bool, str]:
        worked.append(time.monotonic())
        time.sleep(0.2)
        return True, "saved"

    door.serve_aside("~/save", work)
    client, answers, refused = door.create_client(Trigger, "~/save"), [], set()
    assert client.wait_for_service(10.0)
    while len(worked) < 3:
        asked = [client.call_async(Trigger.Request()) for _ in range(2)]
        deadline = time.monotonic() + 20.0
        while not all(one.done() for one in asked) and time.monotonic() < deadline:
            rclpy.spin_once(door, timeout_sec=0.05)
        answers += [one.result().success for one in asked]
        refused |= {one.result().message.partition(" in ")[0] for one in asked if not one.result().success}
    assert refused == {"~/save: call again", "~/save: call again: an earlier call is not done yet"}
    assert sum(answers) <= len(worked) < len(answers)
    assert all(b - a >= 0.2 * (1 + REST) for a, b in pairwise(worked))


def test_what_is_done_aside_is_over_before_a_node_ends(door: Door) -> None:
    done: list[str] = []
    go = threading.Event()
    door.aside(lambda: (go.wait(20.0), done.append("stored")))
    threading.Timer(0.1, go.set).start()
    door.end_aside()
    assert done == ["stored"]
