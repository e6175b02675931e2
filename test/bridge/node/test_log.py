# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_ros.bridge.node.log import ThrottledLog


class Watch:
    """A clock that is set by hand."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_first_of_each_reason_is_said_at_once() -> None:
    lines: list[str] = []
    log = ThrottledLog(lines.append, period_s=5.0, clock=Watch())
    log.warn("a", "one")
    log.warn("b", "two")
    assert lines == ["one", "two"]


def test_a_reminder_comes_once_a_period_and_is_not_counted() -> None:
    lines: list[str] = []
    clock = Watch()
    log = ThrottledLog(lines.append, period_s=5.0, clock=clock)
    for _ in range(11):
        log.remind("a", "still so")
        clock.now += 1.0
    assert lines == ["still so"] * 3


def test_repetitions_are_silent_for_a_period_and_then_counted() -> None:
    lines: list[str] = []
    clock = Watch()
    log = ThrottledLog(lines.append, period_s=5.0, clock=clock)
    for _ in range(4):
        log.warn("a", "again")
    clock.now += 5.0
    log.warn("a", "again")
    assert lines == ["again", "again (and 3 more since the last such line)"]
    clock.now += 5.0
    log.warn("a", "again")
    assert lines[-1] == "again"
