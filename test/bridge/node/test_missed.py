# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_ros.bridge.node.missed import Missed


def test_a_gap_in_the_numbers_is_what_was_missed() -> None:
    missed = Missed()
    assert [missed.before(number) for number in (7, 8, 11, 12)] == [0, 0, 2, 0]


def test_a_publisher_that_starts_again_has_lost_nothing() -> None:
    missed = Missed()
    assert [missed.before(number) for number in (50, 1, 2, 4)] == [0, 0, 0, 1]


def test_without_numbers_nothing_is_claimed() -> None:
    missed = Missed()
    assert [missed.before(number) for number in (None, None, 5, None, 9)] == [0, 0, 0, 0, 0]
