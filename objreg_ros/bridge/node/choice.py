# SPDX-License-Identifier: Apache-2.0
"""One input that may come by several topics: which of them is taken. Knows no ROS."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any, Generic, TypeVar

Subscription = TypeVar("Subscription")


class Choice(Generic[Subscription]):
    """Takes the topic that sends the first valid message and closes the others.

    They are opened again, and the choice with them, when the one that was taken has been silent for ``silence_s``: a
    camera driver may have been started anew with another transport. ``is_valid`` is asked while nothing is taken.
    """

    def __init__(
        self,
        topics: Iterable[str],
        subscribe: Callable[[str], Subscription],
        unsubscribe: Callable[[Subscription], object],
        is_valid: Callable[[str, Any], bool],
        silence_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.topics = tuple(topics)
        self.taken: str | None = None
        self._subscribe, self._unsubscribe, self._is_valid = subscribe, unsubscribe, is_valid
        self._silence_s, self._clock = silence_s, clock
        self._received_at = 0.0
        self._open: dict[str, Subscription] = {}
        self._open_all()

    def choose_topic(self, topic: str, message: Any) -> bool:
        """Whether a message is of a topic that is open still; the first valid one decides."""
        if topic not in self._open:
            return False
        if self.taken is None and self._is_valid(topic, message):
            self._take(topic)
        if topic == self.taken:
            self._received_at = self._clock()
        return True

    def look(self) -> None:
        """Open the others again where the one that was taken is silent; to be called now and again."""
        if self.taken is not None and self._clock() - self._received_at >= self._silence_s:
            self.taken = None
            self._open_all()

    def close(self) -> None:
        """Close every topic."""
        while self._open:
            self._unsubscribe(self._open.popitem()[1])

    def _take(self, topic: str) -> None:
        self.taken = topic
        for other in self.topics:
            if other != topic and other in self._open:
                self._unsubscribe(self._open.pop(other))

    def _open_all(self) -> None:
        for topic in self.topics:
            if topic not in self._open:
                self._open[topic] = self._subscribe(topic)
