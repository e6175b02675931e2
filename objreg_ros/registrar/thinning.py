# SPDX-License-Identifier: Apache-2.0
"""Several closures of one revisit say the same thing many times. The first of each pair of moments is kept."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

REMEMBERED = 4096  # closures that a new one is compared with


class Thinning:
    """Knows the accepted closures of late, and says whether a new pair of moments adds to them."""

    def __init__(self, seconds: float, pairs: Iterable[tuple[int, int]] = ()) -> None:
        self._span_ns = round(1e9 * seconds)
        self._pairs: deque[tuple[int, int]] = deque(pairs, maxlen=REMEMBERED)

    def redundant(self, from_ns: int, to_ns: int) -> bool:
        """Whether an accepted closure joins moments that are both nearer than the span to these."""
        span = self._span_ns
        return any(abs(a - from_ns) < span and abs(b - to_ns) < span for a, b in self._pairs)

    def accept(self, from_ns: int, to_ns: int) -> None:
        """Remember an accepted closure."""
        self._pairs.append((from_ns, to_ns))
