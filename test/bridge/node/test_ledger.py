# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objreg_ros.bridge.node.ledger import Ledger, percentiles_ms

STEPS = st.lists(st.tuples(st.sampled_from(("receive", "publish", "overtaken", "malformed")), st.integers(0, 3)))


@given(STEPS)
def test_the_books_balance_after_every_step(steps: list[tuple[str, int]]) -> None:
    ledger, waiting = Ledger(), Counter[int]()
    for what, stamp_ns in steps:
        if what == "receive":
            ledger.receive(stamp_ns)
            waiting[stamp_ns] += 1
        elif waiting[stamp_ns]:
            waiting[stamp_ns] -= 1
            ledger.publish(stamp_ns) if what == "publish" else ledger.drop(stamp_ns, what)
        books = ledger.balance()
        assert books.received == books.published + books.waiting + sum(books.dropped.values())
        assert books.waiting == waiting.total()
    assert books.received == sum(what == "receive" for what, _ in steps) if steps else True


def test_a_frame_cannot_end_twice() -> None:
    ledger = Ledger()
    ledger.receive(5)
    ledger.publish(5)
    with pytest.raises(KeyError, match="no frame of 5 ns waits"):
        ledger.drop(5, "overtaken")
    assert ledger.balance().dropped == {}


def test_two_frames_of_one_stamp_are_two_frames() -> None:
    ledger = Ledger()
    ledger.receive(0)
    ledger.receive(0)
    ledger.publish(0)
    assert ledger.balance().waiting == 1
    ledger.publish(0)
    assert ledger.balance().published == 2


def test_drops_are_counted_by_reason_and_losses_apart() -> None:
    ledger = Ledger()
    for stamp_ns, reason in enumerate(("overtaken", "malformed_image", "overtaken")):
        ledger.receive(stamp_ns)
        ledger.drop(stamp_ns, reason)
    ledger.lose("image", 4)
    books = ledger.balance()
    assert books.dropped == {"overtaken": 2, "malformed_image": 1} and books.lost == {"image": 4}


def test_percentiles_are_those_of_the_durations() -> None:
    assert percentiles_ms([n / 1000 for n in range(101)]) == pytest.approx((50.0, 95.0))


def test_a_stage_is_measured_and_the_way_from_in_to_out_too() -> None:
    ledger = Ledger()
    ledger.receive(1)
    with ledger.timed("detect"):
        pass
    ledger.publish(1)
    stages = ledger.balance().stage_ms
    assert set(stages) == {"detect", "total"} and 0 <= stages["detect"][0] <= stages["total"][1] < 10_000.0
