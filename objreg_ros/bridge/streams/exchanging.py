# SPDX-License-Identifier: Apache-2.0
"""How a registrar speaks to those of other robots: summaries to all, requests, and the keyframes that were asked for.

The bytes are those of `objreg_ros/registrar/summary.py`, in a sensor_msgs/CompressedImage that is no picture. What one
says all receive, and know by the name of its keyframe whom it is for.
"""

from __future__ import annotations

import time
from array import array
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, Protocol

from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages import headers, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.streams.fair_queue import FairQueue
from objreg_ros.bridge.streams.key import Key

FORMAT = "objreg_exchange"
MOST_UNREAD = 2 * qos.KEPT_SUMMARIES  # summaries that wait to be compared; those beyond are left out
LOOK_S = 0.1  # between two looks at what may be answered


class Exchanges(Protocol):
    """What `registrar.exchange.Exchange` does."""

    counters: Counter[str]

    @property
    def waiting(self) -> int: ...
    def sender(self, packed: bytes) -> str: ...
    def awaits(self, packed: bytes) -> bool: ...
    def receive_summary(self, packed: bytes, now: float) -> bytes | None: ...
    def note(self, packed: bytes, now: float) -> None: ...
    def answer(self, now: float) -> bytes | None: ...


class Delivered(NamedTuple):
    """A keyframe of another robot that was asked for, packed."""

    stamp_ns: int
    packed: bytes
    robot: str = ""

    @property
    def nbytes(self) -> int:
        """The memory that it takes while it waits."""
        return len(self.packed)


class Exchanging:
    """``exchange`` on the topics below ``namespace``. ``node`` counts keyframes, which ``take`` is given.

    Summaries are compared, and requests answered, in a thread of their own: that waits for a search that is under way.
    """

    def __init__(
        self,
        node: NodeBase,
        namespace: str,
        exchange: Exchanges,
        take: Callable[[Delivered], None],
        key: Key | None = None,
    ) -> None:
        self._node, self._exchange, self._take, self._key = node, exchange, take, key or Key()
        self._reader, self._answering = ThreadPoolExecutor(1, "exchange"), False
        self._unread = FairQueue[tuple[int, bytes]](MOST_UNREAD)
        self._summaries = self._both(f"{namespace}/summaries", self._read_later, qos.latched(qos.KEPT_SUMMARIES))
        self._requests = self._both(f"{namespace}/requests", self._note, qos.stage(depth=100))
        self._keyframes = self._both(f"{namespace}/keyframes", self._deliver, qos.stage(depth=qos.KEPT_KEYFRAMES))
        node.create_timer(LOOK_S, self._answer_later, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _both(self, topic: str, receive: Callable[[int, bytes], None], profile: QoSProfile) -> Publisher:
        full = self._node.resolve_topic_name(topic)

        def received(message: Any) -> None:
            packed = self._node.read_aside(topic, lambda sent: _bytes_of(self._key.check(full, sent)), message)
            if packed is not None:
                receive(headers.stamp_ns(message), packed)

        self._node.listen(CompressedImage, topic, received, profile)
        return self._node.create_publisher(CompressedImage, topic, profile)

    def send(self, stamp_ns: int, summary: bytes | None) -> None:
        """Announce a keyframe to all others."""
        self._publish(self._summaries, stamp_ns, summary)

    def _read_later(self, stamp_ns: int, packed: bytes) -> None:
        sender = self._node.read_aside("summaries", self._exchange.sender, packed)
        if sender is not None and self._unread.put(sender, (stamp_ns, packed)):
            self._reader.submit(self._node.read_aside, "summaries", self._read, self._unread)

    def _read(self, unread: FairQueue[tuple[int, bytes]]) -> None:
        stamp_ns, packed = unread.take_next()
        self._publish(self._requests, stamp_ns, self._exchange.receive_summary(packed, time.monotonic()))

    def _note(self, _: int, packed: bytes) -> None:
        self._exchange.note(packed, time.monotonic())

    def _deliver(self, stamp_ns: int, packed: bytes) -> None:
        """What others asked for goes no further, and keeps nothing waiting that was asked for here."""
        if self._node.read_aside("keyframes", self._exchange.awaits, packed):
            self._node.accept(stamp_ns)
            if self._node.let_in(stamp_ns):
                self._take(Delivered(stamp_ns, packed))

    def _answer_later(self) -> None:
        if self._exchange.waiting and not self._answering:
            self._answering = True
            self._reader.submit(self._node.read_aside, "requests", self._answer, time.monotonic())

    def _answer(self, now: float) -> None:
        self._answering = False
        self._publish(self._keyframes, 0, self._exchange.answer(now))

    def _publish(self, publisher: Publisher, stamp_ns: int, packed: bytes | None) -> None:
        if packed is None or not self._node.context.ok():
            return
        data = array("B")
        data.frombytes(packed)
        message = CompressedImage(header=to_msg.header(stamp_ns, ""), format=FORMAT, data=data)
        publisher.publish(self._key.sign(publisher.topic_name, message))

    def close(self) -> None:
        """Compare no more."""
        self._reader.shutdown(cancel_futures=True)


def _bytes_of(message: Any) -> bytes:
    """ValueError for a picture, and for more than a keyframe takes."""
    if message.format != FORMAT or len(message.data) > limits.MOST_PACKED_KEYFRAME:
        got = f"{message.format[:40]!r} of {len(message.data)} bytes"
        raise ValueError(f"exchange: expected {FORMAT!r} of at most {limits.MOST_PACKED_KEYFRAME} bytes, got {got}")
    return bytes(message.data)
