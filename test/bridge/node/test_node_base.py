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
from objreg_ros.bridge.node.drops import Drops
from objreg_ros.bridge.node.log import ThrottledLog
from objreg_ros.bridge.node.node_base import DroppedError, NodeBase
from objreg_ros.bridge.node.services import REST


@pytest.fixture
def node() -> Iterator[NodeBase]:
    rclpy.init(args=[])
    made = NodeBase("node")
    yield made
    made.close()
    rclpy.try_shutdown()


def spin_until(node: NodeBase, received: list[Any], count: int) -> None:
    for _ in range(400):
        if len(received) >= count:
            return
        rclpy.spin_once(node, timeout_sec=0.05)


def refuse(message: Any) -> None:
    raise ValueError(f"expected better than {message!r}")


TEXTS = {"quiet": String, "loud": String}


def decode(_: str, message: Any) -> str:
    if message.data == "bug":
        raise IndexError("nobody expected this")
    if message.data == "junk":
        raise ValueError("expected a text, got junk")
    return message.data


class AbsurdError(Exception):
    """What no decoder should raise."""


def stumble(message: Any) -> None:
    raise AbsurdError("nobody expected this")


@pytest.fixture
def said(node: NodeBase) -> list[str]:
    """The warnings and errors in the log of the node."""
    lines: list[str] = []
    node.throttled = ThrottledLog(lines.append)
    node.get_logger = lambda: SimpleNamespace(error=lines.append)  # type: ignore[method-assign]
    return lines


def test_a_message_that_breaks_its_contract_is_dropped_by_the_name_of_its_topic(node: NodeBase) -> None:
    with pytest.raises(DroppedError, match="expected better than 'x'") as dropped:
        node.read("image", refuse, "x")
    assert dropped.value.reason == "malformed_image"


def test_what_no_decoder_should_raise_drops_the_message_by_the_name_of_the_exception(
    node: NodeBase, said: list[str]
) -> None:
    for _ in range(3):
        with pytest.raises(DroppedError, match="nobody expected this") as dropped:
            node.read("image", stumble, "x")
        assert dropped.value.reason == "malformed_image (AbsurdError)"
        assert node.read_aside("labels", stumble, "x") is None
    assert node._ignored == {"malformed labels (AbsurdError)": 3}
    bugs = [line for line in said if "please report it" in line]
    assert len(bugs) == 2 and all("Traceback" in line and "def stumble" not in line for line in bugs)


def test_a_bug_in_the_work_on_a_frame_is_counted_by_its_name_reported_once_and_the_node_lives(
    node: NodeBase, said: list[str]
) -> None:
    for stamp_ns in (5, 6):
        node.accept(stamp_ns)
        node.conclude(stamp_ns, lambda: stumble(None) is None)
    assert node.accounting.balance().dropped == {"bug (AbsurdError)": 2} and not node.failure.done()
    assert len([line for line in said if "please report it" in line]) == 1


@pytest.mark.parametrize(
    ("error", "counted"),
    [(ValueError("a stamp"), "malformed text"), (SystemError("a bug"), "malformed text (SystemError)")],
)
def test_a_message_that_breaks_where_it_is_received_is_counted_and_the_next_one_is_received(
    node: NodeBase, error: Exception, counted: str
) -> None:
    received: list[str] = []

    def receive(message: Any) -> None:
        if message.data == "bad":
            raise error
        received.append(message.data)

    node.listen(String, "text", receive, qos.stage())
    publisher = node.create_publisher(String, "text", qos.stage())
    spin_until(node, [] if publisher.get_subscription_count() == 0 else [1], 1)
    for data in ("bad", "good"):
        publisher.publish(String(data=data))
    spin_until(node, received, 1)
    assert received == ["good"] and node._ignored == {counted: 1}


@pytest.mark.parametrize("error", [ValueError("too far"), OSError("the disk is full")])
def test_what_breaks_on_one_frame_is_counted_and_the_node_lives(node: NodeBase, error: Exception) -> None:
    def work() -> bool:
        raise error

    node.accept(5)
    node.conclude(5, work)
    assert node.accounting.balance().dropped == {"refused": 1} and not node.failure.done()


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def report_at(node: NodeBase, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], DiagnosticStatus]:
    """The status that a node reports at a time by the clock of its drops."""
    clock = Clock()
    node._drops = Drops(period_s=5.0, clock=clock)
    published: list[Any] = []
    monkeypatch.setattr(node._diagnostics, "publish", published.append)

    def report(now: float) -> DiagnosticStatus:
        clock.now = now
        node._report()
        return published[-1].status[0]

    return report


def test_thirty_of_thirty_malformed_frames_are_a_warning_with_the_reason(
    node: NodeBase, report_at: Callable[[float], DiagnosticStatus]
) -> None:
    for stamp_ns in range(30):
        report_at(stamp_ns * 0.2)
        node.accept(stamp_ns)
        node.conclude(stamp_ns, lambda: bool(node.read("image", refuse, "x")))
    warned = report_at(6.0)
    assert warned.level == DiagnosticStatus.WARN
    assert "30 as malformed image (expected better than 'x')" in warned.message
    node.accept(30)
    node.conclude(30, lambda: True)
    assert report_at(17.0).level == DiagnosticStatus.OK


def test_an_input_beside_the_frames_of_which_everything_is_malformed_is_a_warning(
    node: NodeBase, report_at: Callable[[float], DiagnosticStatus]
) -> None:
    for second in range(7):
        report_at(second)
        node.read_aside("odom", refuse, "x")
        node.read_aside("labels", refuse if second else str.upper, "x")
    assert report_at(6.0).message.startswith("odom: everything was dropped for 6 s, 7 as malformed")
    node.read_aside("odom", str.upper, "x")
    node.read_aside("labels", str.upper, "x")
    assert report_at(17.0).level == DiagnosticStatus.OK


def test_frames_that_newer_ones_overtake_are_no_trouble_where_some_get_through(
    node: NodeBase, report_at: Callable[[float], DiagnosticStatus]
) -> None:
    for stamp_ns in range(100):
        report_at(stamp_ns * 0.2)
        node.accept(stamp_ns)
        if stamp_ns % 20 == 0:
            node.conclude(stamp_ns, lambda: True)
        else:
            node._overtaken((stamp_ns, None))
        assert report_at(stamp_ns * 0.2).level == DiagnosticStatus.OK


def test_a_message_aside_that_breaks_its_contract_is_nothing(node: NodeBase) -> None:
    assert node.read_aside("labels", refuse, "x") is None
    assert node.read_aside("labels", str.upper, "x") == "X"


def test_of_topics_that_carry_the_same_the_first_that_speaks_is_kept_and_the_others_are_closed(node: NodeBase) -> None:
    received: list[tuple[str, str]] = []
    node.listen_to_first("texts", TEXTS, decode, lambda topic, m: received.append((topic, m.data)), qos.stage())
    loud, quiet = (node.create_publisher(String, topic, qos.stage()) for topic in ("loud", "quiet"))
    spin_until(node, [] if loud.get_subscription_count() == 0 else [1], 1)
    loud.publish(String(data="one"))
    spin_until(node, received, 1)
    assert received == [("loud", "one")]
    assert node.count_subscribers("/quiet") == 0 and node.count_subscribers("/loud") == 1
    quiet.publish(String(data="two"))
    loud.publish(String(data="three"))
    spin_until(node, received, 2)
    assert received[1:] == [("loud", "three")] and node.taken("texts") == "loud"


def test_a_message_that_does_not_decode_closes_no_topic(node: NodeBase) -> None:
    received: list[str] = []
    node.listen_to_first("texts", TEXTS, decode, lambda topic, m: received.append(m.data), qos.stage())
    loud, quiet = (node.create_publisher(String, topic, qos.stage()) for topic in ("loud", "quiet"))
    spin_until(node, [] if quiet.get_subscription_count() == 0 else [1], 1)
    for publisher, data in ((loud, "junk"), (loud, "bug"), (quiet, "one")):
        publisher.publish(String(data=data))
        spin_until(node, received, len(received) + 1)
    assert received == ["junk", "bug", "one"] and node.taken("texts") == "quiet"
    assert node.count_subscribers("/loud") == 0


def test_the_other_topics_are_opened_again_once_the_one_that_was_taken_is_silent(node: NodeBase) -> None:
    node.listen_to_first("texts", TEXTS, decode, lambda *_: None, qos.stage())
    choice = node._choices["texts"]
    choice.choose_topic("loud", String(data="one"))
    assert node.count_subscribers("/quiet") == 0
    choice._clock = lambda: time.monotonic() + 5.0
    node._report()
    assert node.taken("texts") is None
    assert node.count_subscribers("/quiet") == node.count_subscribers("/loud") == 1


def test_an_input_that_is_hung_up_has_no_subscriptions_and_receives_nothing_more(node: NodeBase) -> None:
    node.listen_to_first("texts", TEXTS, decode, lambda *_: None, qos.stage())
    assert node.count_subscribers("/quiet") == node.count_subscribers("/loud") == 1
    node.hang_up("texts")
    node.hang_up("never opened")
    assert node.count_subscribers("/quiet") == node.count_subscribers("/loud") == 0


@pytest.mark.parametrize(("publishers", "lost"), [(1, {"text": 3}), (2, {})])
def test_what_the_transport_lost_is_counted_where_one_publisher_numbered_it(
    node: NodeBase, publishers: int, lost: dict[str, int]
) -> None:
    node.count_publishers = {"/text": publishers}.__getitem__  # type: ignore[method-assign]
    for count in (3, 0):
        node._note_loss("text", count)
    assert node.accounting.balance().lost == lost


def test_the_rate_is_of_what_came_since_the_last_report(node: NodeBase) -> None:
    published: list[Any] = []
    node._diagnostics.publish = published.append  # type: ignore[method-assign]
    for since, frames in ((4.0, range(8)), (2.0, range(8, 11))):
        node._last = (time.monotonic() - since, node._last[1])
        for stamp_ns in frames:
            node.accept(stamp_ns)
        node._report()
    rates = [float(value.value) for array in published for value in array.status[0].values if value.key == "rate [Hz]"]
    assert rates == pytest.approx([2.0, 1.5], rel=0.1)


def test_while_a_service_waits_for_work_aside_the_node_goes_on_receiving(node: NodeBase) -> None:
    received: list[str] = []
    go = threading.Event()

    async def answer(_: Any, response: Any) -> Any:
        response.success = await node.aside(lambda: go.wait(20.0))
        return response

    def receive(message: Any) -> None:
        received.append(message.data)
        go.set()

    node.create_service(Trigger, "save", answer, callback_group=node.apart)
    node.listen(String, "text", receive, qos.stage())
    client, publisher = node.create_client(Trigger, "save"), node.create_publisher(String, "text", qos.stage())
    spin_until(node, [] if publisher.get_subscription_count() == 0 else [1], 1)
    asked = client.call_async(Trigger.Request())
    for _ in range(5):
        rclpy.spin_once(node, timeout_sec=0.05)
    assert not asked.done()
    publisher.publish(String(data="one"))
    deadline = time.monotonic() + 60.0
    while not asked.done() and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.05)
    assert received == ["one"] and asked.result().success


def test_whoever_calls_a_service_all_the_time_is_refused_for_most_of_it(node: NodeBase) -> None:
    worked: list[float] = []

    def work() -> tuple[bool, str]:
        worked.append(time.monotonic())
        time.sleep(0.2)
        return True, "saved"

    node.serve_aside("~/save", work)
    client, answers, refused = node.create_client(Trigger, "~/save"), [], set()
    assert client.wait_for_service(10.0)
    while len(worked) < 3:
        asked = [client.call_async(Trigger.Request()) for _ in range(2)]
        deadline = time.monotonic() + 60.0
        while not all(one.done() for one in asked) and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=0.05)
        answers += [one.result().success for one in asked]
        refused |= {one.result().message.partition(" in ")[0] for one in asked if not one.result().success}
    assert refused == {"~/save: call again", "~/save: call again: an earlier call is not done yet"}
    assert sum(answers) <= len(worked) < len(answers)
    assert all(b - a >= 0.2 * (1 + REST) for a, b in pairwise(worked))


def test_what_is_done_aside_is_over_before_a_node_ends(node: NodeBase) -> None:
    done: list[str] = []
    go = threading.Event()
    node.aside(lambda: (go.wait(20.0), done.append("stored")))
    threading.Timer(0.1, go.set).start()
    node.end_aside()
    assert done == ["stored"]
