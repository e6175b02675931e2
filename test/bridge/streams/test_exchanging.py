# SPDX-License-Identifier: Apache-2.0
"""How registrars speak to each other: what is received goes to the exchange, and what it says goes out."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.streams.exchanging import FORMAT, Delivered, Exchanging
from objreg_ros.bridge.streams.key import Key


class Spoken:
    """An exchange that asks for everything, and answers what it was asked for."""

    def __init__(self) -> None:
        self.counters = Counter({"summaries received": 2})
        self.notes = list[bytes]()

    @property
    def waiting(self) -> int:
        return len(self.notes)

    def sender(self, packed: bytes) -> str:
        return packed.decode()

    def awaits(self, packed: bytes) -> bool:
        return packed != b"of others"

    def receive_summary(self, packed: bytes, now: float) -> bytes | None:
        if packed == b"bad":
            raise ValueError("expected a summary, got none")
        return b"ask " + packed if packed != b"unlike" else None

    def note(self, packed: bytes, now: float) -> None:
        self.notes.append(packed)

    def answer(self, now: float) -> bytes | None:
        return b"keyframe " + self.notes.pop()


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[NodeBase]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    rclpy.init(args=["registrar", "--ros-args", "-r", "__ns:=/r1"])
    made = NodeBase("registrar")
    made.throttled._write = lambda line: None
    yield made
    made.close()
    rclpy.try_shutdown()


def message(packed: bytes, form: str = FORMAT) -> CompressedImage:
    return CompressedImage(header=to_msg.header(7, ""), format=form, data=packed)


def said(made: Exchanging, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, bytes]]:
    """What is published from now on, by topic."""
    out = list[tuple[str, bytes]]()
    for publisher in (made._summaries, made._requests, made._keyframes):
        name = publisher.topic_name
        monkeypatch.setattr(publisher, "publish", lambda m, name=name: out.append((name, bytes(m.data))))
    return out


def test_a_summary_that_looks_alike_is_answered_by_a_request_and_one_that_does_not_by_nothing(
    node: NodeBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Exchanging(node, "/fleet", Spoken(), lambda seen: None)
    out = said(made, monkeypatch)
    for packed in (b"alike", b"unlike", b"bad"):
        made._read_later(7, packed)
    made._reader.shutdown()
    assert out == [("/fleet/requests", b"ask alike")] and len(made._unread) == 0
    assert node._ignored == {"malformed summaries": 1}


def test_a_request_is_answered_by_the_keyframe(node: NodeBase, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Exchanging(node, "/fleet", Spoken(), lambda seen: None)
    out = said(made, monkeypatch)
    made._answer_later()
    made._note(7, b"k")
    made._answer_later()
    made._reader.shutdown()
    made.send(7, None)
    made.send(7, b"summary")
    assert out == [("/fleet/keyframes", b"keyframe k"), ("/fleet/summaries", b"summary")]
    made.close()


def test_an_answer_that_waits_for_a_search_keeps_no_subscription_waiting_and_one_at_most_waits_behind(
    node: NodeBase,
) -> None:
    ended, asked = threading.Event(), list[float]()

    class Searching(Spoken):
        def answer(self, now: float) -> bytes | None:
            asked.append(now)
            assert ended.wait(60.0)
            return None

    made = Exchanging(node, "/fleet", Searching(), lambda seen: None)
    made._note(7, b"k")
    made._answer_later()
    while not asked:
        time.sleep(0.001)
    for _ in range(5):
        made._answer_later()
    assert len(asked) == 1
    ended.set()
    made._reader.shutdown()
    assert len(asked) == 2


def test_a_keyframe_that_comes_is_counted_and_handed_on(node: NodeBase) -> None:
    taken = list[Delivered]()
    made = Exchanging(node, "/fleet", Spoken(), taken.append)
    made._deliver(7, b"of others")
    made._deliver(7, b"keyframe")
    assert taken == [Delivered(7, b"keyframe")] and taken[0].nbytes == 8 and node.accounting.balance().waiting == 1
    made.close()


@pytest.mark.parametrize(("packed", "form"), [(b"x", "jpeg"), (bytes(limits.MOST_PACKED_KEYFRAME + 1), FORMAT)])
def test_pictures_and_what_is_too_large_are_counted_and_left_out(node: NodeBase, packed: bytes, form: str) -> None:
    taken = list[Delivered]()
    made = Exchanging(node, "/fleet", Spoken(), taken.append)
    (subscription,) = [s for s in node.subscriptions if s.topic_name == "/fleet/keyframes"]
    subscription.callback(message(packed, form), {"publication_sequence_number": 1})
    assert taken == [] and node._ignored == {"malformed /fleet/keyframes": 1}
    made.close()


def test_a_flood_of_summaries_of_one_keeps_none_of_another_unread(
    node: NodeBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, ended, compared = threading.Event(), threading.Event(), list[bytes]()

    class Searching(Spoken):
        def sender(self, packed: bytes) -> str:
            return packed.decode()[0]

        def receive_summary(self, packed: bytes, now: float) -> bytes | None:
            begun.set()
            assert ended.wait(60.0)
            compared.append(packed)
            return None

    monkeypatch.setattr("objreg_ros.bridge.streams.exchanging.MOST_UNREAD", 10)
    made = Exchanging(node, "/fleet", Searching(), lambda seen: None)
    made._read_later(7, b"e")
    assert begun.wait(60.0)
    for k in range(100):
        made._read_later(7, b"e%d" % k)
    made._read_later(7, b"honest")
    ended.set()
    made._reader.shutdown()
    assert compared.index(b"honest") <= 2 and len(compared) == 11 and not node._ignored


def test_with_a_key_only_what_it_signed_is_read(node: NodeBase, monkeypatch: pytest.MonkeyPatch) -> None:
    taken, key = list[Delivered](), Key(b"0123456789abcdef")
    made = Exchanging(node, "/fleet", Spoken(), taken.append, key)
    (subscription,) = [s for s in node.subscriptions if s.topic_name == "/fleet/keyframes"]
    for sent in (
        message(b"forged"),
        key.sign("/fleet/requests", message(b"moved")),
        key.sign("/fleet/keyframes", message(b"k")),
    ):
        subscription.callback(sent, {"publication_sequence_number": 1})
    assert [one.packed for one in taken] == [b"k"] and node._ignored == {"malformed /fleet/keyframes": 2}
    out = list[CompressedImage]()
    monkeypatch.setattr(made._summaries, "publish", out.append)
    made.send(7, b"summary")
    assert bytes(key.check("/fleet/summaries", out[0]).data) == b"summary"
    made.close()
