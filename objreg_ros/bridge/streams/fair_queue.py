# SPDX-License-Identifier: Apache-2.0
"""A queue in which those who send take turns, so that a flood of one delays and displaces none of another."""

from __future__ import annotations

import threading
from collections import OrderedDict, deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class FairQueue(Generic[Item]):
    """At most ``most`` items, each of a sender. Safe for several threads."""

    def __init__(self, most: int) -> None:
        self._most, self._size, self._lock = most, 0, threading.Lock()
        self._queues = OrderedDict[str, deque[Item]]()  # the sender whose turn it is comes first

    def __len__(self) -> int:
        return self._size

    def put(self, sender: str, item: Item) -> bool:
        """Whether one more item waits now. In a full queue it takes the place of the newest of who has most, if any."""
        with self._lock:
            queue = self._queues.setdefault(sender, deque())
            queue.append(item)
            if self._size < self._most:
                self._size += 1
                return True
            fullest = max(self._queues, key=lambda one: len(self._queues[one]))
            if len(queue) >= len(self._queues[fullest]):
                fullest = sender
            self._queues[fullest].pop()
            if not self._queues[fullest]:
                del self._queues[fullest]
            return False

    def take_next(self) -> Item:
        """The oldest item of the sender whose turn it is; IndexError where none waits."""
        with self._lock:
            if not self._queues:
                raise IndexError("expected an item that waits, got none")
            sender, queue = next(iter(self._queues.items()))
            item = queue.popleft()
            self._size -= 1
            self._queues.move_to_end(sender)
            if not queue:
                del self._queues[sender]
            return item
