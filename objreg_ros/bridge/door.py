# SPDX-License-Identifier: Apache-2.0
"""What every node is: a door. It reads messages, lets its room work, writes messages and keeps the books."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from std_msgs.msg import Header

from objreg_ros.bridge import qos, to_msg
from objreg_ros.bridge.diagnostics import CONNECTED, diagnostic
from objreg_ros.bridge.drops import Drops
from objreg_ros.bridge.ledger import Ledger
from objreg_ros.bridge.log import ThrottledLog
from objreg_ros.bridge.missed import Missed
from objreg_ros.bridge.overridable import OverridableNode
from objreg_ros.bridge.parameters import Parameters
from objreg_ros.bridge.params import DoorParams
from objreg_ros.bridge.watch import Watch
from objreg_ros.bridge.worker import Worker
from objreg_ros.params import Params


class DroppedError(Exception):
    """Ends the work on a frame with a reason that is counted and a text that is logged."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class Door(OverridableNode):
    """A node with declared parameters, one worker, books, diagnostics at 1 Hz and a receipt for every frame.

    A subclass listens, calls `accept` once for each frame, and hands it to ``worker`` as (stamp_ns, payload) when it is
    complete. The worker calls `compute`; what that drops or refuses is counted, logged and leaves the node running.
    """

    def __init__(self, name: str, *kinds: type[Params]) -> None:
        super().__init__(name)
        self.settings = Parameters(self, *kinds, DoorParams)
        self.settings.changed = self.adopt
        self.ledger = Ledger()
        self.connected: dict[str, int] = {}  # full topic name → publishers that DDS has connected us to
        self._opened: dict[str, dict[str, Subscription]] = {}  # input of `listen_to_first` → its open topics
        self._ignored: Counter[str] = Counter()  # messages that are no frame by themselves, by what is wrong with them
        self.apart = ReentrantCallbackGroup()  # of services that wait for work that is done `aside`
        self._aside: list[threading.Thread] = []
        self.failure: Future = Future()
        self.throttled = ThrottledLog(self.get_logger().warning)
        self.watch = Watch(self.count_publishers, self.settings.of(DoorParams).silence)
        self._drops = Drops(self.settings.of(DoorParams).silence)
        self.worker: Worker[tuple[int, Any]] = Worker(self._work, self._overtaken, self.fail)
        self._finished = self.create_publisher(Header, "finished", qos.room(depth=1000))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", qos.room())
        self._last = (time.monotonic(), 0)
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # What a subclass fills in

    def compute(self, stamp_ns: int, payload: Any) -> bool:
        """Read → compute → write for one frame, on the worker. `DroppedError`, ValueError or OSError if it cannot be.

        True when that was all; False when the frame goes on to another worker, which calls `conclude`.
        """
        raise NotImplementedError

    def adopt(self) -> None:
        """Live parameters have changed."""

    def extra_diagnostics(self) -> Mapping[str, object]:
        """What this node adds to its diagnostics."""
        return {}

    # Inputs

    def listen(
        self, kind: type, topic: str, heard: Callable[[Any], None], profile: QoSProfile, watched: str = ""
    ) -> Subscription:
        """Subscribe; ``watched`` is the input of `expect` that this topic belongs to."""

        missed = Missed()

        def hear(message: Any, info: Mapping[str, Any]) -> None:
            self._note_loss(topic, missed.before(info["publication_sequence_number"]))
            self.watch.hear(watched)
            heard(message)

        full = self.resolve_topic_name(topic)
        events = SubscriptionEventCallbacks(matched=partial(self._note_match, full))
        return self.create_subscription(kind, topic, hear, profile, event_callbacks=events)  # type: ignore[arg-type]

    def _note_match(self, topic: str, event: Any) -> None:
        self.connected[topic] = event.current_count

    def _note_loss(self, topic: str, count: int) -> None:
        if count and self.count_publishers(self.resolve_topic_name(topic)) == 1:  # several count each for itself
            self.ledger.lose(topic, count)

    def listen_to_first(
        self, name: str, topics: Mapping[str, type], heard: Callable[[str, Any], None], profile: QoSProfile
    ) -> None:
        """Subscribe to topics that carry the same thing. The first that speaks is kept, the others are closed."""
        opened = self._opened.setdefault(name, {})

        def hear(topic: str, message: Any) -> None:
            if topic not in opened:
                return
            for other in [other for other in opened if other != topic]:
                self.destroy_subscription(opened.pop(other))
            heard(topic, message)

        for topic, kind in topics.items():
            opened[topic] = self.listen(kind, topic, partial(hear, topic), profile, watched=name)
        self.expect(name, *topics)

    def hang_up(self, name: str) -> None:
        """Close every topic of `listen_to_first`; its silence is no longer reported."""
        for subscription in self._opened.pop(name, {}).values():
            self.destroy_subscription(subscription)
        self.watch.forget(name)

    def expect(self, name: str, *topics: str) -> None:
        """Warn when none of ``topics`` speaks."""
        self.watch.expect(name, {topic: self.resolve_topic_name(topic) for topic in topics})

    def sensor(self, depth: int = 10) -> QoSProfile:
        """The QoS of what a camera or an odometry sends."""
        return qos.sensor(self.settings.of(DoorParams).reliable, depth)

    # The life of a frame

    def accept(self, stamp_ns: int) -> None:
        """A frame came in; from now on it is in the books."""
        self.ledger.receive(stamp_ns)

    def drop(self, stamp_ns: int, reason: str, text: str = "") -> None:
        """The frame ends here: counted by reason, receipted, and logged (throttled) if there is a ``text``."""
        self.ledger.drop(stamp_ns, reason)
        self._drops.drop("frames", reason, text)
        if text:
            self.throttled.warn(reason, f"frame dropped, {reason.replace('_', ' ')}: {text}")
        self._finished.publish(to_msg.finished(self.get_name(), stamp_ns, reason))

    def read(self, topic: str, decode: Callable[..., Any], *messages: Any) -> Any:
        """The word of a message; `DroppedError` as ``malformed_<topic>`` if it breaks its contract."""
        try:
            with self.ledger.timed("decode"):
                return decode(*messages)
        except ValueError as error:
            raise DroppedError(f"malformed_{topic}", str(error)) from error

    def read_aside(self, topic: str, decode: Callable[..., Any], message: Any) -> Any:
        """The word of a message that is no frame by itself; None, counted and logged, if it breaks its contract."""
        try:
            word = decode(message)
        except ValueError as error:
            self._ignored[f"malformed {topic}"] += 1
            self._drops.drop(topic, "malformed", str(error))
            self.throttled.warn(f"malformed_{topic}", f"{topic} ignored: {error}")
            return None
        self._drops.let_through(topic)
        return word

    def conclude(self, stamp_ns: int, work: Callable[[], bool]) -> None:
        """Do the last work on a frame and settle it in the books."""
        try:
            done = work()
        except DroppedError as dropped:
            self.drop(stamp_ns, dropped.reason, str(dropped))
        except (ValueError, OSError) as error:
            self.drop(stamp_ns, "refused", str(error))
        else:
            if done:
                self.ledger.publish(stamp_ns)
                self._drops.let_through("frames")
                self._finished.publish(to_msg.finished(self.get_name(), stamp_ns))

    def _work(self, job: tuple[int, Any]) -> None:
        self.conclude(job[0], partial(self.compute, *job))

    def _overtaken(self, job: tuple[int, Any]) -> None:
        self.drop(job[0], "overtaken")  # by a newer frame: usual where the camera is faster than the room

    # Services

    def aside(self, work: Callable[[], Any]) -> Future:
        """What ``work`` gives, done by a thread of its own; for a service to await, so that no subscription waits.

        The service has to be in the group ``apart``: a group does nothing else while one of its callbacks waits.
        """
        executor = self.executor
        future = Future(executor=executor)

        def run() -> None:
            try:
                future.set_result(work())
            except BaseException as error:
                if self.context.ok():  # else nobody waits for it any more
                    future.set_exception(error)
            if executor is not None:
                executor.wake()

        thread = threading.Thread(target=run, name="aside", daemon=True)
        self._aside = [*(other for other in self._aside if other.is_alive()), thread]
        thread.start()
        return future

    def end_aside(self) -> None:
        """Wait for what is done `aside`."""
        for thread in self._aside:
            thread.join()

    # Diagnostics, parameters, the end

    def _report(self) -> None:
        silent = self.watch.silent()
        for name, advice in silent.items():
            self.throttled.remind(name, advice)
        balance = self.ledger.balance()
        (then, before), now = self._last, time.monotonic()
        self._last = (now, balance.received)
        rate = (balance.received - before) / (now - then)
        stamp = self.get_clock().now().to_msg()
        name = self.get_fully_qualified_name()
        connected = {f"{CONNECTED}{topic}": count for topic, count in sorted(self.connected.items())}
        extra = {**connected, **self._ignored, **self.extra_diagnostics()}
        troubles = (*silent.values(), *self._drops.lasting().values())
        self._diagnostics.publish(diagnostic(name, stamp, balance, rate, troubles, extra))

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> SetParametersResult:
        """As rclpy, but refused in the words of `Params`, and with 1 good for 1.0."""
        try:
            return super().set_parameters_atomically(self.settings.checked(parameter_list))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[SetParametersResult]:
        """One by one, each as in `set_parameters_atomically`."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def fail(self, error: BaseException) -> None:
        """A worker met a bug: end the node with it. What fails because ROS is already down is not one."""
        if self.context.ok():
            self.failure.set_exception(error)

    def close(self) -> None:
        """End the worker and the node."""
        self.end_aside()
        self.worker.close()
        self.destroy_node()
