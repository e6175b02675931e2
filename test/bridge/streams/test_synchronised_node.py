# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy

from objreg_ros.bridge.node.log import ThrottledLog
from objreg_ros.bridge.node.node_base import DroppedError
from objreg_ros.bridge.streams.sync import JUMP_NS, PATIENCE_NS, Match, Need, Stream
from objreg_ros.bridge.streams.synchronised_node import ALONE_S, QUIET_S, SynchronisedNode
from objreg_ros.diagnostics import by_key

PATIENCE = 20.0  # seconds; a test that gets there has failed


class Pairs(SynchronisedNode):
    """Takes pairs of ``a`` and ``b``; what to make of them is said by the payload of ``b``."""

    def __init__(self) -> None:
        super().__init__("pairs")
        self.taken: list[tuple[Any, Any]] = []
        self.done = threading.Semaphore(0)

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        try:
            self.taken.append((payload["a"], payload["b"]))
            if isinstance(payload["b"], Exception):
                raise payload["b"]
            return True
        finally:
            self.done.release()

    def wait(self, count: int = 1) -> None:
        for _ in range(count):
            assert self.done.acquire(timeout=PATIENCE)
        self.worker.close()


@pytest.fixture
def node() -> Iterator[Pairs]:
    rclpy.init(args=[])
    made = Pairs()
    yield made
    made.close()
    rclpy.try_shutdown()


@pytest.fixture
def said(node: Pairs) -> list[str]:
    """The warnings of the node."""
    lines: list[str] = []
    node.throttled = ThrottledLog(lines.append)
    return lines


def test_a_frame_goes_to_the_worker_with_its_partner_and_is_booked_as_published(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("a", 5, "a5")
    node.feed("b", 5, "b5")
    node.wait()
    counters = node.accounting.balance()
    assert node.taken == [("a5", "b5")] and (counters.received, counters.published) == (1, 1)


def test_what_comes_before_it_is_known_how_to_match_is_not_lost(node: Pairs) -> None:
    node.feed("b", 5, "b5")
    node.feed("elsewhere", 5, "x")
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("a", 5, "a5")
    node.wait()
    assert node.taken == [("a5", "b5")]


def test_several_frames_that_came_early_are_matched_in_the_order_they_came_in(node: Pairs) -> None:
    found: list[Match] = []
    node.worker.put = lambda job: found.append(job[1])  # type: ignore[method-assign]
    for stamp_ns in (9 + JUMP_NS, 3, 4, 5):  # the clock began anew after the first
        node.feed("a", stamp_ns, f"a{stamp_ns}")
    for stamp_ns in (3, 4, 5):
        node.feed("b", stamp_ns, f"b{stamp_ns}")
    assert not node.begun and not found
    node.start_matching([Stream("a"), Stream("b")])
    assert node.begun and [(match["a"], match["b"]) for match in found] == [("a3", "b3"), ("a4", "b4"), ("a5", "b5")]
    assert node.accounting.balance().dropped == {"time_jump": 1}


def test_what_came_once_is_not_pushed_out_by_a_busy_stream_before_matching_begins(node: Pairs) -> None:
    node.feed("names", 0, "cup")
    for stamp_ns in range(1000):
        node.feed("b", stamp_ns, f"b{stamp_ns}")
    node.start_matching([Stream("a"), Stream("b"), Stream("names", Need.LATCHED)])
    node.feed("a", 999, "a999")
    node.wait()
    assert node.taken == [("a999", "b999")]


def test_a_frame_goes_without_what_is_optional_once_every_stream_has_been_quiet_for_a_while(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b"), Stream("odom", Need.OPTIONAL)])
    node.feed("odom", 4, "odom")
    for k, name in enumerate("ab"):
        node.feed(name, 5, f"{name}5")
        for _ in range(round(QUIET_S / ALONE_S)):
            node._look_after()
        assert node.accounting.balance().waiting == 1, f"quiet for too short a time after message {k}"
    node._look_after()
    node.wait()
    assert node.taken == [("a5", "b5")] and node.accounting.balance().waiting == 0


def test_a_frame_whose_partner_never_came_is_dropped_as_unmatched(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("a", 5, "a5")
    node.feed("b", 6, "b6")
    counters = node.accounting.balance()
    assert (counters.received, counters.dropped, counters.waiting) == (1, {"unmatched": 1}, 0)


def test_the_log_says_what_a_frame_without_a_partner_lacked(node: Pairs, said: list[str]) -> None:
    node.start_matching([Stream("a"), Stream("b", slop_ns=20_000_000), Stream("names", Need.LATCHED)])
    node.feed("b", 0, "b")
    node.feed("names", 0, "cup")
    node.feed("a", 30_000_000, "a")
    node.feed("b", 60_000_000, "b")
    assert said == [
        "frame dropped, unmatched: expected b within 20 ms of it (slop), got none; does its node run and keep up?"
    ]


def test_the_log_names_all_that_a_frame_waited_for_until_the_queue_was_full(node: Pairs, said: list[str]) -> None:
    node.start_matching([Stream("a", depth=1), Stream("b"), Stream("names", Need.LATCHED)])
    node.feed("a", 5, "a5")
    node.feed("a", 6 + PATIENCE_NS, "a6")
    assert len(said) == 1
    assert said[0].startswith("frame dropped, queue full: expected b of its very stamp and names before it, got none")


def test_the_log_says_that_time_went_back(node: Pairs, said: list[str]) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("a", 5 + JUMP_NS, "a5")
    node.feed("a", 3, "a3")
    node.feed("a", 4, "a4")
    assert said == ["frame dropped, time jump: time went back to before it while it waited"]


def test_the_log_says_that_a_stamp_is_odd(node: Pairs, said: list[str]) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    for stamp in (5 + JUMP_NS, 3, 6 + JUMP_NS):
        node.feed("a", stamp, "a")
    assert said == ["frame dropped, odd stamp: its stamp is far from those before and after it"]


def test_the_log_says_that_a_frame_came_late(node: Pairs, said: list[str]) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("a", 5, "a5")
    node.feed("a", 3, "a3")
    assert said == ["frame dropped, late: one with a later stamp came before it"]


@pytest.mark.parametrize(
    ("error", "reason"), [(DroppedError("disabled", ""), "disabled"), (ValueError("a broken contract"), "refused")]
)
def test_what_the_work_refuses_is_dropped_with_its_reason(node: Pairs, error: Exception, reason: str) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("b", 5, error)
    node.feed("a", 5, "a5")
    node.wait()
    assert node.accounting.balance().dropped == {reason: 1} and not node.failure.done()


def test_a_bug_in_the_work_drops_the_frame_by_its_name_and_the_node_goes_on(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b")])
    node.feed("b", 5, TypeError("a bug"))
    node.feed("a", 5, "a5")
    node.wait()
    assert node.accounting.balance().dropped == {"bug (TypeError)": 1} and not node.failure.done()


def test_streams_may_be_matched_anew_and_keep_what_is_latched(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b"), Stream("c", Need.LATCHED), Stream("d", Need.LATCHED)])
    node.feed("c", 0, "c0")
    node.feed("a", 5, "a5")
    node.start_matching([Stream("b"), Stream("c", Need.LATCHED)])
    assert node.accounting.balance().dropped == {"unmatched": 1}
    node.feed("b", 6, "b6")
    node.worker.close()
    assert node.accounting.balance().received == 2
    assert by_key(*node.own_diagnostics()) == {"c received": 1}


def test_diagnostics_state_what_the_other_streams_brought(node: Pairs) -> None:
    node.start_matching([Stream("a"), Stream("b"), Stream("c", Need.LATCHED)])
    node.feed("c", 0, "c")
    node.feed("b", 5, "b5")
    node.feed("b", 6, "b6")
    node.feed("a", 6, "a6")
    node.wait()
    values = by_key(*node.own_diagnostics())
    assert values == {"b received": 2, "b unmatched": 1, "c received": 1}
