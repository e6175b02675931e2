# SPDX-License-Identifier: Apache-2.0
"""A flood of one sender takes nothing from another."""

from __future__ import annotations

import pytest

from objreg_ros.bridge.streams.fair_queue import FairQueue


def test_senders_take_turns_and_each_keeps_its_order() -> None:
    queue = FairQueue[str](10)
    assert all(queue.put(item[0], item) for item in ("a1", "a2", "a3", "b1", "c1", "b2"))
    assert [queue.take_next() for _ in range(len(queue))] == ["a1", "b1", "c1", "a2", "b2", "a3"]
    with pytest.raises(IndexError):
        queue.take_next()


def test_in_a_full_queue_the_newest_of_who_has_most_gives_way_and_as_many_are_taken_as_were_put() -> None:
    queue = FairQueue[str](4)
    put = [queue.put(item[0], item) for item in ("e1", "e2", "e3", "e4", "e5", "a1", "a2", "a3", "b1")]
    assert sum(put) == len(queue) == 4
    assert [queue.take_next() for _ in range(4)] == ["e1", "a1", "b1", "a2"]
    assert len(queue) == 0


def test_of_a_full_queue_of_one_the_newest_is_left_out() -> None:
    queue = FairQueue[str](2)
    assert [queue.put("e", item) for item in "123"] == [True, True, False]
    assert [queue.take_next(), queue.take_next()] == ["1", "2"]
