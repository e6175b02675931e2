# SPDX-License-Identifier: Apache-2.0
"""The keyframes that others ask of us, shared fairly: who asks more than others waits longer, and delays none."""

from __future__ import annotations

from collections import Counter, OrderedDict
from typing import NamedTuple

import numpy as np

PATIENCE_S = 60.0  # that a request waits
AGAIN_S = 60.0  # before the same asker gets the same keyframe again
MOST_WAITING = 1000  # requests
MOST_ANSWERED = 4096  # that are remembered


class _Wish(NamedTuple):
    votes: float
    since: float


class Wishes:
    """Keyframes that others asked for, by asker. Askers take turns, each with the most promising of its own.

    ``counters`` counts what is given up, by reason.
    """

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self._queues = OrderedDict[str, dict[int, _Wish]]()  # the asker whose turn it is comes first
        self._answered = OrderedDict[tuple[str, int], float]()  # when, by who asked and the keyframe

    def __len__(self) -> int:
        """How many keyframes are waited for."""
        return len({number for queue in self._queues.values() for number in queue})

    def add_wish(self, asker: str, number: int, votes: float, now: float) -> None:
        """One more request; repeated, it counts once. Of too many goes the least promising of who has most."""
        if asker and now - self._answered.get((asker, number), -np.inf) < AGAIN_S:
            self._counters["dropped: answered before"] += 1
            return
        queue = self._queues.setdefault(asker, {})
        queue[number] = _Wish(votes, queue[number].since if number in queue else now)
        if sum(map(len, self._queues.values())) > MOST_WAITING:
            fullest = max(self._queues, key=lambda one: len(self._queues[one]))
            self._give_up(fullest, min(self._queues[fullest], key=lambda n: self._queues[fullest][n].votes), "crowded")

    def expire(self, now: float) -> None:
        """Give up what waited too long."""
        late = [
            (a, n) for a, queue in self._queues.items() for n, wish in queue.items() if now - wish.since > PATIENCE_S
        ]
        for asker, number in late:
            self._give_up(asker, number, "waited too long")

    def next_wish(self, now: float) -> int | None:
        """The most promising keyframe of the asker whose turn it is; one answer is for all who asked. None if none."""
        if not self._queues:
            return None
        asker = next(iter(self._queues))
        number = max(self._queues[asker], key=lambda n: (self._votes(n), -n))
        self._queues.move_to_end(asker)
        for other in [one for one, queue in self._queues.items() if number in queue]:
            self._forget(other, number)
            self._answered[other, number] = now
        while len(self._answered) > MOST_ANSWERED:
            self._answered.popitem(last=False)
        return number

    def _votes(self, number: int) -> float:
        return sum(queue[number].votes for queue in self._queues.values() if number in queue)

    def _give_up(self, asker: str, number: int, why: str) -> None:
        self._forget(asker, number)
        self._counters[f"dropped: {why}"] += 1

    def _forget(self, asker: str, number: int) -> None:
        del self._queues[asker][number]
        if not self._queues[asker]:
            del self._queues[asker]
