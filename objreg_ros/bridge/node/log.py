# SPDX-License-Identifier: Apache-2.0
"""Warnings that repeat are said once, then counted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

PERIOD_S = 5.0


class ThrottledLog:
    """Says the first of each reason at once, then at most one line a reason and period, with how many there were."""

    def __init__(
        self, write: Callable[[str], object], period_s: float = PERIOD_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._write, self._period_s, self._clock = write, period_s, clock
        self._lock = threading.Lock()
        self._said_at: dict[str, float] = {}
        self._silent: dict[str, int] = {}

    def warn(self, reason: str, text: str) -> None:
        """One more of ``reason``; ``text`` is what the log shows if it is time to say it."""
        with self._lock:
            due = self._due(reason)
            silent = self._silent.pop(reason, 0) if due else 0
            if not due:
                self._silent[reason] = self._silent.get(reason, 0) + 1
        if due:
            self._write(f"{text} (and {silent} more since the last such line)" if silent else text)

    def remind(self, reason: str, text: str) -> None:
        """Something is still so; how often it was asked does not matter."""
        with self._lock:
            due = self._due(reason)
        if due:
            self._write(text)

    def _due(self, reason: str) -> bool:
        now = self._clock()
        if now - self._said_at.get(reason, -float("inf")) < self._period_s:
            return False
        self._said_at[reason] = now
        return True
