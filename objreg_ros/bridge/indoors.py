# SPDX-License-Identifier: Apache-2.0
"""What nodes of one process say to each other without DDS: words, by the full names of their topics."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.publisher import Publisher


class Surplus(NamedTuple):
    """The word of a picture that was left out to keep a pace."""

    stamp_ns: int
    frame_id: str


class Indoors:
    """The topics that nodes of this process offer to each other, and who listens. Offered before it is listened to."""

    def __init__(self) -> None:
        self._ears: dict[str, list[Ear]] = {}

    def offer(self, topic: str) -> None:
        """A node will hand over words of a topic."""
        self._ears.setdefault(topic, [])

    def offers(self, topic: str) -> bool:
        """Whether a node of this process hands over words of a topic."""
        return topic in self._ears

    def add(self, ear: Ear) -> None:
        """From now on an ear hears the words of its topic; KeyError for one that nobody offers."""
        self._ears[ear.topic_name].append(ear)

    def remove(self, ear: Ear) -> None:
        """It hears no more."""
        self._ears[ear.topic_name].remove(ear)

    def hand_over(self, topic: str, word: Any) -> None:
        """Give a word to all who listen, from whatever thread; never waits."""
        for ear in tuple(self._ears.get(topic, ())):
            ear.inlet.put(ear.hear, word)


class Inlet:
    """Brings words to a node in the order in which they came, by its executor, as if they were messages.

    It needs no bound: what is handed over was made of what the same executor had time to hear.
    """

    def __init__(self, node: Node) -> None:
        self._waiting: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._bell = node.create_guard_condition(self._bring)

    def put(self, hear: Callable[[Any], None], word: Any) -> None:
        """Let the executor call ``hear`` with a word."""
        self._waiting.append((hear, word))
        self._bell.trigger()

    def _bring(self) -> None:
        while self._waiting:
            hear, word = self._waiting.popleft()
            hear(word)


class Ear(NamedTuple):
    """Takes the place of a subscription."""

    topic_name: str
    inlet: Inlet
    hear: Callable[[Any], None]


class Outlet:
    """A topic that a node publishes where somebody listens, and hands over as a word to nodes of its own process."""

    def __init__(self, publisher: Publisher, indoors: Indoors) -> None:
        self._publisher, self._indoors = publisher, indoors
        indoors.offer(publisher.topic_name)

    def tell(self, word: Any, write: Callable[[], Any]) -> None:
        """Tell a word; ``write`` makes the message of it, and is called only where a message has a reader."""
        self._indoors.hand_over(self._publisher.topic_name, word)
        if self._publisher.get_subscription_count():
            self._publisher.publish(write())
