# SPDX-License-Identifier: Apache-2.0
"""The course of time in one stream: a stamp alone in a time of its own is an error, two are a jump of the clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from objreg_ros.data.frames import JUMP_NS

AHEAD_NS = 60_000_000_000  # a stamp that leaps so far ahead is believed once the next one follows it
PERIODS = 2  # of a stream have to pass until its silence speaks for what is held

T = TypeVar("T")


class ClockMonitor(Generic[T]):
    """Holds an item whose stamp leaps until the next one of its stream shows whether time has leapt with it.

    A leap is back by `JUMP_NS` or ahead by `AHEAD_NS`: of a looped bag or a clock that was set, or of one message that
    was stamped wrongly, which must not part what came before from what comes after. ``on_alone`` is given the stamp and
    the item of such a one. What nothing speaks against for a while, longer where items come seldom, is believed too:
    who sends one item and waits for what becomes of it sends no next one.
    """

    def __init__(self, on_alone: Callable[[int, T], None]) -> None:
        self._on_alone = on_alone
        self._held: tuple[int, T] | None = None
        self._asked: tuple[int, T] | None = None  # what was held at the last `believe`
        self._waited_ns = 0  # since that was asked for first
        self._last_ns: int | None = None
        self._period_ns = 0  # between the last two that were in order

    @property
    def holding(self) -> bool:
        """Whether an item waits for the next one."""
        return self._held is not None

    def admit(self, stamp_ns: int, item: T) -> list[tuple[int, T]]:
        """The stamps and items that may be taken in now, in order: mostly this one, none or two around a leap."""
        held, self._held = self._held, None
        if held is not None and self._follows(stamp_ns, held[0]):
            self._last_ns = stamp_ns
            return [held, (stamp_ns, item)]
        self._let_go(held)
        if self._leaps(stamp_ns):
            self._held = stamp_ns, item
            return []
        if self._last_ns is None:
            self._last_ns = stamp_ns
        elif stamp_ns > self._last_ns:
            self._last_ns, self._period_ns = stamp_ns, stamp_ns - self._last_ns
        return [(stamp_ns, item)]

    def believe(self, passed_ns: int) -> list[tuple[int, T]]:
        """The stamp and item that were held at the last call of this already, and for as long as two more take to come.

        To be called now and again, with the time that has passed since the last call.
        """
        held, asked = self._held, self._asked
        self._asked, self._waited_ns = held, self._waited_ns + passed_ns if held is asked else 0
        if held is None or held is not asked or self._waited_ns < PERIODS * self._period_ns:
            return []
        self._held, self._last_ns = None, held[0]
        return [held]

    def release_held(self) -> list[tuple[int, T]]:
        """What is held, since nothing more will speak against it; what leapt back is let go, and parts nothing."""
        held, self._held = self._held, None
        if held is not None and self._last_ns is not None and held[0] > self._last_ns:
            return [held]
        self._let_go(held)
        return []

    def _let_go(self, held: tuple[int, T] | None) -> None:
        if held is not None:
            self._on_alone(*held)

    def _follows(self, stamp_ns: int, held_ns: int) -> bool:
        """Whether a stamp goes on from the one that is held, and not from those before it."""
        return self._last_ns is not None and 0 <= stamp_ns - held_ns <= abs(stamp_ns - self._last_ns)

    def _leaps(self, stamp_ns: int) -> bool:
        if self._last_ns is None:
            return False
        return stamp_ns <= self._last_ns - JUMP_NS or stamp_ns >= self._last_ns + AHEAD_NS
