# SPDX-License-Identifier: Apache-2.0
"""What every node here is: a node through which constraints come once each, wait for a consumer and go to it."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType

from objreg_mapper.adapters.diagnostics import AdapterDiagnostics
from objreg_mapper.adapters.params import AdapterParams
from objreg_ros.bridge.messages import closures_msg, from_msg, headers
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.closures import LoopClosure, Moments
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.params import Params

LOOK_S = 0.1  # between two looks at what waits
MOST_KNOWN = 100_000  # constraints that are remembered, so that none is taken twice


def require(kind: object, package: str, install: str) -> None:
    """ValueError, which ends the node with one line, where the messages of a consumer are not installed."""
    if kind is None:
        raise ValueError(f"expected the messages of {package}, got none that are installed: {install}")


class Adapter(NodeBase):
    """It counts constraints. A subclass fills in `hand_over`, and calls `listen_for_closures` when it is made."""

    def __init__(self, name: str, *kinds: type[Params]) -> None:
        super().__init__(name, *kinds, AdapterParams)
        self._params = self.settings.of(AdapterParams)
        self.waiting: dict[Moments, LoopClosure] = {}
        self._taken: dict[Moments, bool] = {}  # whether it was handed over; of all that came, the oldest first
        self._keys: dict[str, Moments] = {}  # id of objreg_msgs → key
        self._may_come_again = set[str]()  # ids that were retracted, and are not with the consumer
        self._again = self._retracted = self._retracted_late = 0

    # What a subclass fills in

    def hand_over(self, closure: LoopClosure) -> bool:
        """Give a constraint to the consumer; False while it has to wait. `DroppedError` or ValueError if it cannot be.

        Called again and again while it waits.
        """
        raise NotImplementedError

    def take_back(self, key: Moments) -> bool:
        """Take a constraint that was handed over out of the consumer's graph; False where that is not possible."""
        return False

    def forget_constraint(self, key: Moments) -> None:
        """A constraint no longer waits."""

    def is_in_flight(self, key: Moments) -> bool:
        """Whether the consumer is asked just now, and so may have a constraint that waits."""
        return False

    # Inputs

    def listen_for_closures(self) -> None:
        """Subscribe to the constraints, and look at what waits from now on."""
        kept = qos.latched(qos.KEPT_CONSTRAINTS)
        whole = closures_msg.LoopClosureMsg
        if self._params.input == "loop_closures":
            require(
                whole, "objreg_msgs", "build objreg_msgs/ of this repository with colcon, or set input:=constraints"
            )
        if self._params.input != "constraints" and whole is not None:
            self.listen(whole, "loop_closures", self._on_whole, kept)
        if self._params.input != "loop_closures":
            self.listen(Odometry, "constraints", self._on_constraint, kept)
        self.create_timer(LOOK_S, self.go_through, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_constraint(self, message: Any) -> None:
        self._take("constraints", message, from_msg.loop_closure)

    def _on_whole(self, message: Any) -> None:
        if message.retracted:
            self._retract(message.id)
            return
        if message.id in self._may_come_again:
            self._may_come_again.discard(message.id)
            self._taken.pop(self._keys[message.id], None)
        closure = self._take("loop_closures", message, closures_msg.read_loop_closure)
        if closure is not None:
            self._keys[headers.bounded(message.id, "id")] = closure.moments
            while len(self._keys) > MOST_KNOWN:
                self._may_come_again.discard(oldest := next(iter(self._keys)))
                del self._keys[oldest]

    def _take(self, topic: str, message: Any, decode: Any) -> LoopClosure | None:
        """The constraint of a message, which waits from now on unless it came before; None for one that is none."""
        closure = self.read_aside(topic, decode, message)
        if closure is None:
            stamp_ns = headers.stamp_ns(message)
            self.accept(stamp_ns)
            self.drop(stamp_ns, f"malformed_{topic}")
        elif closure.moments in self._taken:
            self._again += 1
        else:
            self._admit(closure)
        return closure

    def _admit(self, closure: LoopClosure) -> None:
        self.accept(closure.to_ns)
        self._taken[closure.moments] = False
        while len(self._taken) > MOST_KNOWN:
            del self._taken[next(iter(self._taken))]
        self.waiting[closure.moments] = closure
        while len(self.waiting) > self._params.most_waiting:
            oldest = next(key for key in self.waiting if not self.is_in_flight(key))
            self.drop_constraint(oldest, "queue_full", "its consumer is not there, or takes fewer than come")

    def _retract(self, name: str) -> None:
        key = self._keys.get(name)
        self._retracted += 1
        if key in self.waiting:
            if not self.is_in_flight(key):
                self._may_come_again.add(name)
            self.drop_constraint(key, "retracted")
            return
        if key is not None and self._taken.get(key, False) and self._withdraw(key):
            self._may_come_again.add(name)

    def _withdraw(self, key: Moments) -> bool:
        """Take back what was handed over, and say where that is too late; whether it was not."""
        self._taken[key] = False  # it came: by whatever topic it comes again, it stays out
        if self.take_back(key):
            return True
        self._retracted_late += 1
        self.throttled.warn("retracted_late", "a constraint is withdrawn that its consumer has and cannot give up")
        return False

    # What waits

    def go_through(self) -> None:
        """Try to hand over everything that waits, the oldest first."""
        for key, closure in list(self.waiting.items()):
            if key in self.waiting:
                self.conclude(closure.to_ns, partial(self._handed_over, key, closure))

    def _handed_over(self, key: Moments, closure: LoopClosure) -> bool:
        try:
            done = self.hand_over(closure)
        except BaseException:
            self._leave(key)
            raise
        if done:
            self._leave(key)
            self._taken[key] = True
        return done

    def note_delivered(self, key: Moments) -> None:
        """The consumer has a constraint that was in flight, which may have been withdrawn meanwhile."""
        closure = self.waiting.get(key)
        if closure is None:
            self._withdraw(key)
            return
        self._leave(key)
        self._taken[key] = True
        self.conclude(closure.to_ns, lambda: True)

    def drop_constraint(self, key: Moments, reason: str, text: str = "") -> None:
        """Drop a constraint that waits."""
        closure = self.waiting[key]
        self._leave(key)
        self.drop(closure.to_ns, reason, text)

    def _leave(self, key: Moments) -> None:
        self.waiting.pop(key, None)
        self.forget_constraint(key)

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What came more than once, and what was withdrawn."""
        own = AdapterDiagnostics(repeated=self._again, retracted=self._retracted, retracted_late=self._retracted_late)
        return (*super().own_diagnostics(), own)


def seconds() -> float:
    """A clock for patience, which no stamp and no simulation moves."""
    return time.monotonic()
