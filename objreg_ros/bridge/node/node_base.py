# SPDX-License-Identifier: Apache-2.0
"""The base class of all nodes. It reads messages, runs the node's work, writes messages and keeps the counters."""

from __future__ import annotations

import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import Header

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.accounting import Accounting
from objreg_ros.bridge.node.choice import Choice
from objreg_ros.bridge.node.common import MALFORMED, CommonDiagnostics
from objreg_ros.bridge.node.diagnostics import diagnostic
from objreg_ros.bridge.node.drops import Drops
from objreg_ros.bridge.node.log import ThrottledLog
from objreg_ros.bridge.node.missed import Missed
from objreg_ros.bridge.node.parameters import Parameters
from objreg_ros.bridge.node.params import ManagedParams, NodeBaseParams
from objreg_ros.bridge.node.services import ServingNode
from objreg_ros.bridge.node.watch import Watch
from objreg_ros.bridge.node.worker import Worker
from objreg_ros.bridge.process.intra_process import IntraProcessBus, LocalPublisher, LocalSubscription, ValueQueue
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.params import Params
from objreg_ros.plausibility.finding import Finding

INACTIVE = "inactive"  # why a frame ends that came to a managed node that is not active


class DroppedError(Exception):
    """Ends the work on a frame with a reason that is counted and a text that is logged."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class NodeBase(ServingNode):
    """A node with declared parameters, one worker, counters, diagnostics at 1 Hz and an acknowledgement of each frame.

    A subclass listens in `open`, calls `accept` once for each frame, and hands it to ``worker`` as (stamp_ns, payload)
    when it is complete and was `let_in`. The worker calls `compute`; what that drops or refuses is counted, logged and
    leaves the node running.
    ``bus`` passes values between the nodes of this process; None where each has a process of its own.
    """

    def __init__(self, name: str, *kinds: type[Params], bus: IntraProcessBus | None = None) -> None:
        super().__init__(name)
        self._shared_bus, self._queue = bus, ValueQueue(self)
        self.settings = Parameters(self, *kinds, NodeBaseParams)
        self.settings.changed, self.settings.are_open = self._adopt_if_open, lambda: not self.is_open
        self._bugs: set[str] = set()  # those that were logged
        self.throttled = ThrottledLog(self.get_logger().warning)
        self._finished = self.create_publisher(Header, "finished", qos.stage(depth=1000))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", qos.stage())
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))
        life = self.settings.of(ManagedParams) if ManagedParams in kinds else ManagedParams()
        if life.managed and bus is not None:
            raise ValueError(f"{name}: managed: expected false where all nodes are in one process, got true")
        self.begin_life(life)

    def prepare(self) -> None:
        """Empty counters, a new worker, and nothing that is listened to; by the parameters as they are now."""
        params = self.settings.of(NodeBaseParams)
        self.bus = IntraProcessBus() if self._shared_bus is None else self._shared_bus
        self.accounting, self._last = Accounting(), (time.monotonic(), 0)
        self.connected: dict[str, int] = {}  # full topic name → publishers that DDS has connected us to
        self._choices: dict[str, Choice[Subscription | LocalSubscription]] = {}  # by the input of `listen_to_first`
        self._passed_on = set[str]()
        self._ignored: Counter[str] = Counter()  # messages that are no frame by themselves, by what is wrong with them
        self.most_pixels, self.is_enabled = params.most_pixels, True
        self.watch, self._drops = Watch(self.count_publishers, params.silence), Drops(params.silence)
        self.worker: Worker[tuple[int, Any]] = Worker(self._work, self._overtaken, self.fail)

    # What a subclass fills in

    def compute(self, stamp_ns: int, payload: Any) -> bool:
        """Read → compute → write for one frame, on the worker. `DroppedError`, ValueError or OSError if it cannot be.

        True when that was all; False when the frame was `hand_on`ed to another worker, which calls `conclude`.
        """
        raise NotImplementedError

    def apply_parameters(self) -> None:
        """Live parameters have changed."""

    def _adopt_if_open(self) -> None:
        if self.is_open:
            self.apply_parameters()

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What this node reports beside what nodes have in common."""
        return ()

    def found(self) -> Sequence[Finding]:
        """What this node finds its stream to have; a warning in its diagnostics."""
        return ()

    # Inputs

    def listen(
        self, kind: type, topic: str, received: Callable[[Any], None], profile: QoSProfile, watched: str = ""
    ) -> Subscription | LocalSubscription:
        """Subscribe; ``watched`` is the input of `expect` that this topic belongs to.

        Where a node of this process offers the topic, ``received`` is given its values instead of messages.
        """
        full = self.resolve_topic_name(topic)
        if self.bus.offers(full) and full not in self._passed_on:
            return self._subscribe_in_process(full, topic, received, watched)
        missed = Missed()

        def receive(message: Any, info: Mapping[str, Any]) -> None:
            self._note_loss(topic, missed.before(info["publication_sequence_number"]))
            self.watch.note_input(watched)
            self._pass(topic, received, message)

        events = SubscriptionEventCallbacks(matched=partial(self._note_match, full))
        return self.create_subscription(kind, topic, receive, profile, event_callbacks=events)  # type: ignore[arg-type]

    def _subscribe_in_process(
        self, full: str, topic: str, received: Callable[[Any], None], watched: str
    ) -> LocalSubscription:
        def receive(value: Any) -> None:
            self.watch.note_input(watched)
            self._pass(topic, received, value)

        subscription = LocalSubscription(full, self._queue, receive)
        self.bus.add_subscription(subscription)
        self.connected[full] = 1
        return subscription

    def offer(self, kind: type, topic: str, profile: QoSProfile) -> LocalPublisher:
        """Publish a topic whose values the nodes of this process get directly."""
        return LocalPublisher(self.create_publisher(kind, topic, profile), self.bus)

    def pass_on(self, topic: str) -> None:
        """Offer the nodes of this process the values of a topic that this node itself receives from outside."""
        self._passed_on.add(self.resolve_topic_name(topic))
        self.bus.offer(self.resolve_topic_name(topic))

    def _pass(self, topic: str, received: Callable[[Any], None], message: Any) -> None:
        """Hand a message on. None ends the node: what breaks its contract already here is counted, and logged."""
        whole = f"messages of {topic}"
        try:
            received(message)
        except Exception as error:
            self._ignore(topic, error, whole)
        else:
            self._drops.let_through(whole)

    def _ignore(self, topic: str, error: Exception, part: str) -> None:
        """Count and log what is no frame by itself and breaks its contract; ``part`` is whose drops are watched."""
        self._ignored[self._named(f"{MALFORMED}{topic}", error)] += 1
        self._drops.drop(part, "malformed", str(error))
        self.throttled.warn(f"malformed_{topic}", f"{topic} ignored: {error}")

    def _named(self, reason: str, error: Exception) -> str:
        """The reason; with the exception's name if it is no ValueError, whose traceback is then logged once."""
        if isinstance(error, ValueError):
            return reason
        named = f"{reason} ({type(error).__name__})"
        if named not in self._bugs:
            self._bugs.add(named)
            trace = "".join(traceback.format_exception(error))
            self.get_logger().error(f"{named}: a bug, and the node goes on; please report it with these lines: {trace}")
        return named

    def _note_match(self, topic: str, event: Any) -> None:
        self.connected[topic] = event.current_count

    def _note_loss(self, topic: str, count: int) -> None:
        if count and self.count_publishers(self.resolve_topic_name(topic)) == 1:  # several count each for itself
            self.accounting.lose(topic, count)

    def listen_to_first(
        self,
        name: str,
        topics: Mapping[str, type],
        decode: Callable[[str, Any], object],
        received: Callable[[str, Any], None],
        profile: QoSProfile,
        profiles: Mapping[str, QoSProfile] = MappingProxyType({}),
    ) -> None:
        """Subscribe to topics of the same content; the first whose message decodes is `taken`.

        The others are closed until that one has been silent for the parameter ``silence``. ``received`` is given the
        topic and the message, those too that come before one is taken. ``profiles`` are those of topics that have
        another.
        """

        def receive(topic: str, message: Any) -> None:
            if self._choices[name].choose_topic(topic, message):
                received(topic, message)

        def subscribe(topic: str) -> Subscription | LocalSubscription:
            return self.listen(
                topics[topic], topic, partial(receive, topic), profiles.get(topic, profile), watched=name
            )

        silence_s = self.settings.of(NodeBaseParams).silence
        is_valid = partial(_decodes, decode)
        self._choices[name] = Choice(topics, subscribe, self._unsubscribe, is_valid, silence_s)
        self.expect(name, *topics)

    def _unsubscribe(self, subscription: Subscription | LocalSubscription) -> None:
        self.connected.pop(subscription.topic_name, None)
        if isinstance(subscription, LocalSubscription):
            self.bus.remove(subscription)
        else:
            self.destroy_subscription(subscription)

    def taken(self, name: str) -> str | None:
        """The topic that an input of `listen_to_first` comes by; None before a valid message, or after a silence."""
        return self._choices[name].taken

    def hang_up(self, name: str) -> None:
        """Close every topic of `listen_to_first`; its silence is no longer reported."""
        if name in self._choices:
            self._choices.pop(name).close()
        self.watch.unwatch(name)

    def expect(self, name: str, *topics: str) -> None:
        """Warn when none of ``topics`` speaks."""
        self.watch.expect(name, {topic: self.resolve_topic_name(topic) for topic in topics})

    def sensor(self, depth: int = 10) -> QoSProfile:
        """The QoS of what a camera or an odometry sends."""
        return qos.sensor(self.settings.of(NodeBaseParams).reliable, depth)

    # The life of a frame

    def accept(self, stamp_ns: int) -> None:
        """A frame came in; from now on it is in the counters."""
        self.accounting.count_frame(stamp_ns)

    def let_in(self, stamp_ns: int) -> bool:
        """Whether a frame that was accepted goes on; else it ends here: a managed node lets none in while inactive."""
        if not self.is_active:
            self.leave_out(stamp_ns, INACTIVE)
        return self.is_active

    def hand_on(self, stamp_ns: int) -> None:
        """The frame's own work is done, and another worker has its keyframe now: acknowledged, and in the counters."""
        self.accounting.hand_on(stamp_ns)
        self._finished.publish(to_msg.followed(self.get_name(), stamp_ns))

    def drop(self, stamp_ns: int, reason: str, text: str = "") -> None:
        """The frame ends here: counted by reason, receipted, and logged (throttled) if there is a ``text``."""
        self._drops.drop("frames", reason, text)
        if text:
            self.throttled.warn(reason, f"frame dropped, {reason.replace('_', ' ')}: {text}")
        self.leave_out(stamp_ns, reason)

    def leave_out(self, stamp_ns: int, reason: str) -> None:
        """The frame ends here on purpose: counted by reason and receipted, and no trouble."""
        self.accounting.drop(stamp_ns, reason)
        self._finished.publish(to_msg.finished(self.get_name(), stamp_ns, reason))

    def read(self, topic: str, decode: Callable[..., Any], *messages: Any) -> Any:
        """The value of a message; `DroppedError` as ``malformed_<topic>`` if it breaks its contract.

        With the name of the exception behind that if it is one that no decoder should raise.
        """
        try:
            with self.accounting.timed("decode"):
                return decode(*messages)
        except Exception as error:
            raise DroppedError(self._named(f"malformed_{topic}", error), str(error)) from error

    def read_aside(self, topic: str, decode: Callable[..., Any], message: Any) -> Any:
        """The value of a message that is no frame by itself; None, counted and logged, if it breaks its contract."""
        try:
            value = decode(message)
        except Exception as error:
            self._ignore(topic, error, topic)
            return None
        self._drops.let_through(topic)
        return value

    def conclude(self, stamp_ns: int, work: Callable[[], bool]) -> None:
        """Do the last work on a frame and settle it in the counters; what nobody expected drops it as a ``bug``."""
        with self.accounting.working():
            self._settle(stamp_ns, work)

    def _settle(self, stamp_ns: int, work: Callable[[], bool]) -> None:
        try:
            done = work()
        except DroppedError as dropped:
            self.drop(stamp_ns, dropped.reason, str(dropped))
        except (ValueError, OSError) as error:
            self.drop(stamp_ns, "refused", str(error))
        except Exception as error:
            self.drop(stamp_ns, self._named("bug", error), str(error))
        else:
            if done:
                self.accounting.publish(stamp_ns)
                self._drops.let_through("frames")
                self._finished.publish(to_msg.finished(self.get_name(), stamp_ns))

    def _work(self, job: tuple[int, Any]) -> None:
        self.conclude(job[0], partial(self.compute, *job))

    def _overtaken(self, job: tuple[int, Any]) -> None:
        self.drop(job[0], "overtaken")  # by a newer frame: usual where the camera is faster than the node

    # Diagnostics, parameters, the end

    def _report(self) -> None:
        for choice in self._choices.values():
            choice.look()
        silent = self.watch.silent() if self.is_active else {}
        for name, advice in silent.items():
            self.throttled.remind(name, advice)
        balance = self.accounting.balance()
        (then, before), now = self._last, time.monotonic()
        self._last = (now, balance.received)
        rate = (balance.received - before) / (now - then)
        stamp = self.get_clock().now().to_msg()
        name = self.get_fully_qualified_name()
        own, found = (self.own_diagnostics(), self.found()) if self.is_open else ((), ())
        common = CommonDiagnostics.of(
            balance,
            rate,
            state=self.state if self.is_managed else None,
            connected=self.connected,
            malformed={named.removeprefix(MALFORMED): count for named, count in self._ignored.items()},
            found={finding.anchor: finding.text for finding in found},
        )
        asked = () if self.is_enabled else ("disabled by ~/enable",)
        troubles = (*asked, *silent.values(), *self._drops.lasting().values(), *(finding.what for finding in found))
        self._diagnostics.publish(diagnostic(name, stamp, troubles, common, *own))

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> SetParametersResult:
        """As rclpy, but with the error messages of `Params`, and with 1 accepted as 1.0."""
        try:
            return super().set_parameters_atomically(self.settings.checked(parameter_list))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[SetParametersResult]:
        """One by one, each as in `set_parameters_atomically`."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def end_work(self) -> None:
        """End the worker."""
        self.worker.close()

    def shut(self) -> None:
        """End what is done `aside`, and the worker."""
        self.end_aside()
        self.end_work()

    def close(self) -> None:
        """End the work and the node."""
        try:
            if self.is_open:
                self.shut()
        finally:
            self.end_work()
            self.destroy_node()


def _decodes(decode: Callable[[str, Any], object], topic: str, message: Any) -> bool:
    try:
        decode(topic, message)
    except Exception:  # whatever it is, it is counted where the message is read
        return False
    return True
