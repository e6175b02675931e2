# SPDX-License-Identifier: Apache-2.0
"""Publishes recorded messages into the live graph: at their own pace, or as fast as the graph takes them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from objreg_ros.bridge.messages import headers, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams.acknowledgements import DEPTH, IMAGE, ORDER, Acknowledgements

QUEUE = 20  # messages of a topic that wait in DDS for a slow reader
LATCHED = 100  # messages of a latched topic that are kept: a recording has those of all its publishers in one
ASK_AGAIN_S = 2.0  # how often a play that waits looks whether the nodes are still there
START_S = 300.0  # how long the start of a node may take
PARTICIPANT = 12  # bytes
INPUTS = {  # what a node receives the nodes before it
    "segmenter": ("detections_table", "labels"),
    "registrar": ("objects", "view", "view/camera_info", "gravity", "labels"),
}
SETTLE_S = 3.0  # for the nodes to find us and each other, after we have found some of them
# One image and one depth are in flight at a time, so that none is overtaken. Where the graph stays silent, it may
# wait for what comes next (slow odometry, say): one more goes after each of these times of silence.
SILENCE_S = (1.0, 10.0, 30.0)
LAST_S = 5.0  # how long to wait at the end for depth that is newer than any image: it has no partner


@dataclass(frozen=True, slots=True)
class PlayedMessage:
    """One message to publish: where, when it was recorded, and its CDR bytes.

    A lossless play follows an image or a depth (``kind``) by the stamp in its header.
    """

    topic: str
    stamp_ns: int
    cdr: bytes
    kind: str = ""
    header_ns: int = 0


class Player(Node):
    """A node that plays items on ``topics`` (topic → type like ``sensor_msgs/msg/Image``).

    A late subscriber still gets the last message played on the ``latched`` ones.
    """

    def __init__(self, topics: Mapping[str, str], clock: bool = False, latched: Collection[str] = ()) -> None:
        super().__init__("player")
        self._publishers_of = {
            topic: self._advertise(topic, kind, qos.latched(LATCHED) if topic in latched else qos.stage(QUEUE))
            for topic, kind in topics.items()
        }
        self._ticks = self.create_publisher(Clock, "/clock", qos.stage()) if clock else None
        self._acknowledgements: Acknowledgements | None = None
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._received = self._asked = 0.0
        self.published: Counter[str] = Counter()
        self.lost: list[int] = []

    def _advertise(self, topic: str, kind: str, profile: QoSProfile) -> Publisher:
        return self.create_publisher(message_type(kind), topic, profile)

    # Who listens

    def wait_for_listeners(self, topics: Iterable[str], seconds: float) -> list[str]:
        """Wait until somebody subscribes to each of ``topics``; those that nobody knew of within ``seconds``."""
        wanted = [self._publishers_of[topic] for topic in topics]
        deadline = time.monotonic() + seconds
        while any(p.get_subscription_count() == 0 for p in wanted) and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)
        self._wait_until(time.monotonic() + SETTLE_S)
        return [p.topic_name for p in wanted if p.get_subscription_count() == 0]

    def subscribe_to_acknowledgements(self, seconds: float) -> Acknowledgements:
        """Wait for the nodes that acknowledgement frames; ValueError if there are none within ``seconds``.

        A node that is there is waited for until it listens to its inputs.
        """
        self.create_subscription(Header, "finished", self._receive, qos.stage(depth=1000))
        self._spin_until(lambda: set(ORDER) <= self._receipting(), seconds)
        nodes = self._receipting() & set(ORDER)
        if not nodes:
            raise ValueError("lossless: expected the nodes to publish `finished`, got none; are they running here?")
        if not self._spin_until(lambda: not self._deaf(nodes), START_S):
            raise ValueError(f"lossless: expected listening nodes, got none on {', '.join(self._deaf(nodes))}")
        self._wait_until(time.monotonic() + SETTLE_S)
        self._acknowledgements = Acknowledgements(nodes)
        return self._acknowledgements

    def _spin_until(self, true: Callable[[], bool], seconds: float) -> bool:
        deadline = time.monotonic() + seconds
        while not true() and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)
        return true()

    def _receipting(self) -> set[str]:
        return {info.node_name for info in self.get_publishers_info_by_topic(self.resolve_topic_name("finished"))}

    def _deaf(self, nodes: Iterable[str]) -> list[str]:
        """What the nodes should listen to and do not yet."""
        return [topic for node in nodes for topic in INPUTS.get(node, ()) if not self._is_received(topic, node)]

    def _is_received(self, topic: str, node: str) -> bool:
        return node in self._listeners(topic) or self._at_home(node, topic)

    def _at_home(self, node: str, topic: str) -> bool:
        """Whether a topic comes from the very process of a node, which hands it over without DDS."""
        acknowledgements = self.get_publishers_info_by_topic(self.resolve_topic_name("finished"))
        mine = {_process(info) for info in acknowledgements if info.node_name == node}
        return any(_process(info) in mine for info in self.get_publishers_info_by_topic(self.resolve_topic_name(topic)))

    def _listeners(self, topic: str) -> set[str]:
        return {info.node_name for info in self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic))}

    def _receive(self, acknowledgement: Header) -> None:
        self._received = time.monotonic()
        if self._acknowledgements is not None:
            self._acknowledgements.read_acknowledgement(acknowledgement.frame_id, headers.stamp_ns(acknowledgement))

    # Play

    def play(
        self, items: Iterable[PlayedMessage], rate: float | None, on_item: Callable[[PlayedMessage], None]
    ) -> None:
        """Publish items in order: at ``rate`` times their own pace, or at once if it is None."""
        start_ns, start = None, 0.0
        for item in items:
            if start_ns is None:
                start_ns, start = item.stamp_ns, time.monotonic()
            if rate is not None:
                self._wait_until(start + (item.stamp_ns - start_ns) * 1e-9 / rate)
            self._publish(item)
            on_item(item)

    def play_lossless(
        self, items: Iterable[PlayedMessage], patience: float, on_item: Callable[[PlayedMessage], None]
    ) -> None:
        """Publish items in order, a frame only when the graph can take it; returns when all are through.

        When no acknowledgement comes for ``patience`` seconds, what is in flight goes to ``lost`` and the play goes on.
        ValueError when a node has ended.
        """
        acknowledgements = self._acknowledgements
        if acknowledgements is None:
            raise ValueError("expected subscribe_to_acknowledgements before a lossless play")
        newest_image_ns = 0
        for item in items:
            if item.kind:
                self._wait_for_space(acknowledgements, item.kind, patience)
                acknowledgements.send(item.kind, item.header_ns)
            if item.kind == IMAGE:
                newest_image_ns = item.header_ns
            self._publish(item)
            on_item(item)
        self._wait_for_end(acknowledgements, newest_image_ns, patience)

    def _wait_for_space(self, acknowledgements: Acknowledgements, kind: str, patience: float) -> None:
        self._received = time.monotonic()
        while acknowledgements.waiting(kind) > sum(self._silence > seconds for seconds in SILENCE_S):
            self._attend(acknowledgements, patience)

    def _wait_for_end(self, acknowledgements: Acknowledgements, newest_image_ns: int, patience: float) -> None:
        self._received = time.monotonic()
        while waiting := acknowledgements.waiting(IMAGE) + acknowledgements.waiting(DEPTH):
            alone = acknowledgements.waiting(DEPTH, after_ns=newest_image_ns) == waiting
            self._attend(acknowledgements, min(patience, LAST_S) if alone else patience)

    @property
    def _silence(self) -> float:
        """Seconds without an acknowledgement."""
        return time.monotonic() - self._received

    def _attend(self, acknowledgements: Acknowledgements, patience: float) -> None:
        """Let acknowledgements come in; see what is lost, and whether the nodes are still there."""
        self._executor.spin_once(timeout_sec=0.05)
        if self._silence > patience:
            self.lost += acknowledgements.give_up()
        if time.monotonic() - self._asked > ASK_AGAIN_S:
            self._asked = time.monotonic()
            self._require(acknowledgements.nodes)

    def _require(self, nodes: Iterable[str]) -> None:
        ended = set(nodes) - self._receipting()
        if ended:
            raise ValueError(f"lossless: {', '.join(sorted(ended))} has ended and takes no more frames; see its log")

    def _wait_until(self, end_s: float) -> None:
        while (left := end_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def _publish(self, item: PlayedMessage) -> None:
        if self._ticks is not None:
            self._ticks.publish(to_msg.clock(item.stamp_ns))
        self._publishers_of[item.topic].publish(item.cdr)
        self.published[item.topic] += 1

    def close(self) -> None:
        """End the node."""
        self.destroy_node()
        self._executor.shutdown()  # last: the thread that received a signal may still ring the bell that this destroys


def _process(info: TopicEndpointInfo) -> tuple[int, ...]:
    """The participant of an endpoint: what its GUID begins with, as DDS has it."""
    return tuple(info.endpoint_gid[:PARTICIPANT])


def is_installed(kind: str) -> bool:
    """Whether `message_type` has the class of a type."""
    try:
        message_type(kind)
    except ValueError:
        return False
    return True


def message_type(kind: str) -> Any:
    """The class of a type like ``sensor_msgs/msg/Image``; ValueError if its package is not installed."""
    package, _, name = kind.replace("/msg/", "/").partition("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, TypeError) as error:
        raise ValueError(
            f"{kind or 'no type'}: expected an installed message type, got none; leave its topic out"
        ) from error
