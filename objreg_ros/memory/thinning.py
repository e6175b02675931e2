# SPDX-License-Identifier: Apache-2.0
"""Several closures of one revisit say the same thing many times. The first of each pair of moments is kept."""

from __future__ import annotations

from collections import defaultdict


class Thinning:
    """Knows the accepted closures of a run of the clock, and says whether a new pair of moments adds to them."""

    def __init__(self, seconds: float) -> None:
        self._span_ns = max(round(1e9 * seconds), 1)
        self._pairs: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)  # by the span that the later one is in

    def redundant(self, from_ns: int, to_ns: int) -> bool:
        """Whether an accepted closure joins moments that are both nearer than the span to these."""
        span = self._span_ns
        pairs = (pair for k in (-1, 0, 1) for pair in self._pairs.get(to_ns // span + k, ()))
        return any(abs(a - from_ns) < span and abs(b - to_ns) < span for a, b in pairs)

    def withdraw(self, from_ns: int, to_ns: int) -> None:
        """Forget a closure that was accepted, and came to nothing."""
        self._pairs[to_ns // self._span_ns].remove((from_ns, to_ns))

    def accept(self, from_ns: int, to_ns: int) -> None:
        """Remember an accepted closure."""
        self._pairs[to_ns // self._span_ns].append((from_ns, to_ns))
