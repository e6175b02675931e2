# SPDX-License-Identifier: Apache-2.0
"""Values that the nodes of one process pass to each other in memory, without DDS, by full topic names."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.publisher import Publisher


class Surplus(NamedTuple):
    """Stands for an image that the detector left out to keep to its rate."""

    stamp_ns: int
    frame_id: str


class Indoors:
    """The topics that nodes of this process pass to each other in memory, and the subscribers of each.

    A topic must be offered before a subscriber is added.
    """

    def __init__(self) -> None:
        self._ears: dict[str, list[Ear]] = {}

    def offer(self, topic: str) -> None:
        """Announce that a node of this process will publish a topic."""
        self._ears.setdefault(topic, [])

    def offers(self, topic: str) -> bool:
        """Whether a node of this process publishes a topic."""
        return topic in self._ears

    def add(self, ear: Ear) -> None:
        """Add a subscriber of its topic; KeyError if no node of this process offers that topic."""
        self._ears[ear.topic_name].append(ear)

    def remove(self, ear: Ear) -> None:
        """Remove a subscriber."""
        self._ears[ear.topic_name].remove(ear)

    def hand_over(self, topic: str, word: Any) -> None:
        """Pass a value to all subscribers of a topic. Any thread may call this; it never blocks."""
        for ear in tuple(self._ears.get(topic, ())):
            ear.inlet.put(ear.hear, word)


class Inlet:
    """Queues values for a node. The executor of the node takes them in order, as it takes messages.

    The queue needs no limit: each value was made from a message that the same executor took before.
    """

    def __init__(self, node: Node) -> None:
        self._waiting: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._bell = node.create_guard_condition(self._bring)

    def put(self, hear: Callable[[Any], None], word: Any) -> None:
        """Let the executor call ``hear`` with a value."""
        self._waiting.append((hear, word))
        self._bell.trigger()

    def _bring(self) -> None:
        while self._waiting:
            hear, word = self._waiting.popleft()
            hear(word)


class Ear(NamedTuple):
    """A subscriber, in the place of a subscription of ROS."""

    topic_name: str
    inlet: Inlet
    hear: Callable[[Any], None]


class Outlet:
    """Publishes a topic of a node: in memory to nodes of its process, as messages to the subscribers of ROS."""

    def __init__(self, publisher: Publisher, indoors: Indoors) -> None:
        self._publisher, self._indoors = publisher, indoors
        indoors.offer(publisher.topic_name)

    def tell(self, word: Any, write: Callable[[], Any]) -> None:
        """Publish a value. ``write`` makes its message, and is called only if the topic has a subscriber of ROS."""
        self._indoors.hand_over(self._publisher.topic_name, word)
        if self._publisher.get_subscription_count():
            self._publisher.publish(write())
