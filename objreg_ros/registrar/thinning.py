# SPDX-License-Identifier: Apache-2.0
"""Several closures of one revisit repeat each other. The first of each pair of keyframes is kept.

Keyframes of different sessions may have one stamp, where they are of different robots.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable


class Thinning:
    """Knows the accepted closures of a run of the clock, and says whether a new pair of keyframes adds to them.

    A pair is of ``session`` and ``from_ns`` of the stored keyframe, and ``to_ns`` of the one that goes on.
    """

    def __init__(self, seconds: float) -> None:
        self._span_ns = max(round(1e9 * seconds), 1)
        self._pairs: defaultdict[int, list[tuple[int, int, int]]] = defaultdict(list)  # by the span of the later one

    def redundant(self, session: int, from_ns: int, to_ns: int) -> bool:
        """Whether an accepted closure joins keyframes that are both nearer than the span to these."""
        span = self._span_ns
        pairs = (pair for k in (-1, 0, 1) for pair in self._pairs.get(to_ns // span + k, ()))
        return any(one == session and abs(a - from_ns) < span and abs(b - to_ns) < span for one, a, b in pairs)

    def withdraw(self, session: int, from_ns: int, to_ns: int) -> None:
        """Forget a closure that was accepted, and came to nothing or was withdrawn; nothing where it is not known."""
        pairs = self._pairs.get(to_ns // self._span_ns, [])
        if (pair := (session, from_ns, to_ns)) in pairs:
            pairs.remove(pair)

    def accept(self, session: int, from_ns: int, to_ns: int) -> None:
        """Remember an accepted closure."""
        self._pairs[to_ns // self._span_ns].append((session, from_ns, to_ns))

    def recall(self, accepted: Iterable[tuple[int, int, int]]) -> None:
        """Remember what was accepted before: pairs as `accept` has them."""
        for pair in accepted:
            self.accept(*pair)
