# SPDX-License-Identifier: Apache-2.0
"""Says of which input of a node everything is dropped, and why. Knows no ROS."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from objreg_ros.bridge.node.watch import PERIOD_S


@dataclass
class _Row:
    """The drops of an input since its last message that got through, and when they were last reported as trouble."""

    since: float = 0.0
    last: float = 0.0
    counts: Counter[str] = field(default_factory=Counter)
    why: dict[str, str] = field(default_factory=dict)  # reason → what was said of the last
    reported_at: float = -float("inf")
    report: str = ""


class Drops:
    """The inputs that send messages of which none gets through; safe to use from several threads.

    An input is in trouble after a period in which it had only drops, and more than one. The trouble ends two periods
    after a message got through, or after the last drops: where one in many gets through, the report has no break.
    """

    def __init__(self, period_s: float = PERIOD_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._period_s, self._clock = period_s, clock
        self._lock = threading.Lock()
        self._rows: dict[str, _Row] = {}

    def drop(self, name: str, reason: str, why: str = "") -> None:
        """Something of the input ``name`` was dropped."""
        with self._lock:
            row = self._rows.setdefault(name, _Row())
            row.last = self._clock()
            if not row.counts:
                row.since = row.last
            row.counts[reason] += 1
            row.why[reason] = why

    def let_through(self, name: str) -> None:
        """Something of the input got through."""
        with self._lock:
            if name in self._rows:
                self._rows[name].counts.clear()

    def lasting(self) -> dict[str, str]:
        """input → how long everything of it has been dropped, by reason, and what was said of the most frequent."""
        with self._lock:
            now = self._clock()
            for name, row in self._rows.items():
                lasted, ago = now - row.since, now - row.last
                if row.counts and lasted >= self._period_s > ago:
                    row.reported_at, row.report = now, _text(name, row, lasted)
            return {name: row.report for name, row in self._rows.items() if now - row.reported_at < 2 * self._period_s}


def _text(name: str, row: _Row, seconds: float) -> str:
    most = row.counts.most_common()
    counts = ", ".join(f"{count} as {reason.replace('_', ' ')}" for reason, count in most)
    why = row.why[most[0][0]]
    return f"{name}: everything was dropped for {seconds:.0f} s, {counts}{f' ({why})' if why else ''}"
