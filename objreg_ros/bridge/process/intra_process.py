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


class IntraProcessBus:
    """The topics that nodes of this process pass to each other in memory, and the subscribers of each.

    A topic must be offered before a subscriber is added.
    """

    def __init__(self) -> None:
        self._subscriptions: dict[str, list[LocalSubscription]] = {}

    def offer(self, topic: str) -> None:
        """Announce that a node of this process will publish a topic."""
        self._subscriptions.setdefault(topic, [])

    def offers(self, topic: str) -> bool:
        """Whether a node of this process publishes a topic."""
        return topic in self._subscriptions

    def add_subscription(self, subscription: LocalSubscription) -> None:
        """Add a subscriber of its topic; KeyError if no node of this process offers that topic."""
        self._subscriptions[subscription.topic_name].append(subscription)

    def remove(self, subscription: LocalSubscription) -> None:
        """Remove a subscriber."""
        self._subscriptions[subscription.topic_name].remove(subscription)

    def hand_over(self, topic: str, passed: Any) -> None:
        """Pass a value to all subscribers of a topic. Any thread may call this; it never blocks."""
        for subscription in tuple(self._subscriptions.get(topic, ())):
            subscription.queue.put(subscription.receive, passed)


class ValueQueue:
    """Queues values for a node. The executor of the node takes them in order, as it takes messages.

    The queue needs no limit: each value was made from a message that the same executor took before.
    """

    def __init__(self, node: Node) -> None:
        self._waiting: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._bell = node.create_guard_condition(self._bring)

    def put(self, receive: Callable[[Any], None], passed: Any) -> None:
        """Let the executor call ``receive`` with a value."""
        self._waiting.append((receive, passed))
        self._bell.trigger()

    def _bring(self) -> None:
        while self._waiting:
            receive, value = self._waiting.popleft()
            receive(value)


class LocalSubscription(NamedTuple):
    """A subscriber, in the place of a subscription of ROS."""

    topic_name: str
    queue: ValueQueue
    receive: Callable[[Any], None]


class LocalPublisher:
    """Publishes a topic of a node: in memory to nodes of its process, as messages to the subscribers of ROS."""

    def __init__(self, publisher: Publisher, bus: IntraProcessBus) -> None:
        self._publisher, self._bus = publisher, bus
        bus.offer(publisher.topic_name)

    def publish(self, value: Any, write: Callable[[], Any]) -> None:
        """Publish a value. ``write`` makes its message, and is called only if the topic has a subscriber of ROS."""
        self._bus.hand_over(self._publisher.topic_name, value)
        if self._publisher.get_subscription_count():
            self._publisher.publish(write())
