# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.streams.clock_monitor import AHEAD_NS, ClockMonitor
from objreg_ros.data.frames import JUMP_NS

NOW = 1000 * JUMP_NS
PASSED = JUMP_NS // 2  # between two calls of `believe`


def passed(stamps: list[int]) -> tuple[list[int], list[int]]:
    """The stamps that were admitted, and those that were found alone."""
    alone: list[int] = []
    monitor: ClockMonitor[str] = ClockMonitor(lambda stamp_ns, item: alone.append(stamp_ns))
    admitted = [stamp_ns for stamp in stamps for stamp_ns, _ in monitor.admit(stamp, "item")]
    admitted += [stamp_ns for stamp_ns, _ in monitor.release_held()]
    assert not monitor.holding
    return admitted, alone


def test_what_is_in_order_or_a_little_late_passes_at_once() -> None:
    stamps = [NOW, NOW + 5, NOW + 3, NOW + 5, NOW + JUMP_NS // 2, NOW + 4]
    assert passed(stamps) == (stamps, [])


@pytest.mark.parametrize("odd", [0, NOW + 1 - JUMP_NS, NOW + 1 + AHEAD_NS])
def test_one_that_leaps_alone_is_kept_out(odd: int) -> None:
    assert passed([NOW, NOW + 1, odd, NOW + 2, NOW + 3]) == ([NOW, NOW + 1, NOW + 2, NOW + 3], [odd])


@pytest.mark.parametrize("leap", [-JUMP_NS, -NOW, AHEAD_NS])
def test_two_that_leap_are_a_jump_of_the_clock(leap: int) -> None:
    stamps = [NOW, NOW + leap, NOW + leap + 1, NOW + leap + 2]
    assert passed(stamps) == (stamps, [])


def test_two_of_the_very_same_time_are_a_jump_of_the_clock_too() -> None:
    assert passed([NOW, 0, 0, 1]) == ([NOW, 0, 0, 1], [])


def test_one_that_is_late_does_not_set_the_clock_back() -> None:
    late = NOW - JUMP_NS // 2
    assert passed([NOW, late, NOW - JUMP_NS, NOW + 1]) == ([NOW, late, NOW + 1], [NOW - JUMP_NS])


def test_of_two_that_leap_to_different_times_the_last_is_asked_for() -> None:
    assert passed([NOW, NOW + 2 * AHEAD_NS, 5, 6]) == ([NOW, 5, 6], [NOW + 2 * AHEAD_NS])


def test_one_that_nothing_speaks_against_for_a_while_is_believed() -> None:
    monitor: ClockMonitor[str] = ClockMonitor(lambda stamp_ns, item: pytest.fail("it was let go"))
    assert monitor.admit(NOW, "old") == [(NOW, "old")] and monitor.believe(PASSED) == []
    assert monitor.admit(5, "new") == []
    assert monitor.believe(PASSED) == [] and monitor.believe(PASSED) == [(5, "new")] and monitor.believe(PASSED) == []
    assert monitor.admit(6, "newer") == [(6, "newer")]


@pytest.mark.parametrize("period", [JUMP_NS, 3 * JUMP_NS])
def test_one_that_leaps_alone_is_not_believed_before_the_next_of_a_slow_stream_can_come(period: int) -> None:
    alone: list[int] = []
    monitor: ClockMonitor[str] = ClockMonitor(lambda stamp_ns, item: alone.append(stamp_ns))
    for stamp in (NOW, NOW + period, NOW + period, 0):
        monitor.admit(stamp, "item")
    assert all(monitor.believe(PASSED) == [] for _ in range(1 + period // PASSED))
    assert monitor.admit(NOW + 3 * period, "next") == [(NOW + 3 * period, "next")] and alone == [0]


def test_each_one_that_leaps_has_its_own_while() -> None:
    alone: list[int] = []
    monitor: ClockMonitor[str] = ClockMonitor(lambda stamp_ns, item: alone.append(stamp_ns))
    for stamp in (NOW, 0):
        monitor.admit(stamp, "item")
    assert monitor.believe(PASSED) == []
    for stamp in (NOW + 1, 1):
        monitor.admit(stamp, "item")
    assert monitor.believe(PASSED) == [] and monitor.believe(PASSED) == [(1, "item")] and alone == [0]


def test_one_that_leaps_back_at_the_end_is_let_go_and_one_that_leaps_ahead_is_believed() -> None:
    assert passed([NOW, 0]) == ([NOW], [0])
    assert passed([NOW, NOW + AHEAD_NS]) == ([NOW, NOW + AHEAD_NS], [])
