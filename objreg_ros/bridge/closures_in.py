# SPDX-License-Identifier: Apache-2.0
"""How a node hears closures: on `loop_closures` of objreg_msgs, on `constraints`, or on both and each once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from nav_msgs.msg import Odometry

from objreg_ros.bridge import closures_msg, from_msg, qos
from objreg_ros.bridge.door import Door
from objreg_ros.data import LoopClosure, Moments

MOST_KNOWN = 100_000  # closures that are remembered, so that none is taken twice


class ClosuresIn:
    """The books of ``door`` count closures. ValueError for `loop_closures` where objreg_msgs is not installed.

    ``take`` is given what was accepted, ``again`` what is known and now names its sessions, ``withdraw`` the moments of
    what is taken back. `forget` lets a closure come once more.
    """

    def __init__(
        self,
        door: Door,
        topic: str,
        take: Callable[[LoopClosure], None],
        again: Callable[[LoopClosure], None],
        withdraw: Callable[[Moments], None],
    ) -> None:
        self._door, self._take, self._again, self._withdraw = door, take, again, withdraw
        self._known: dict[Moments, None] = {}  # the oldest first
        self._moments: dict[str, Moments] = {}  # by the id of objreg_msgs
        whole, kept = closures_msg.LoopClosureMsg, qos.latched(qos.KEPT_CONSTRAINTS)
        if topic == "loop_closures" and whole is None:
            raise ValueError("input: expected objreg_msgs, got none: build it with colcon, or set input:=constraints")
        if topic != "constraints" and whole is not None:
            door.listen(whole, "loop_closures", self._hear_whole, kept)
        if topic != "loop_closures":
            door.listen(Odometry, "constraints", self._hear_constraint, kept)

    def know(self, closures: Iterable[LoopClosure]) -> None:
        """These were taken before."""
        self._known.update((closure.moments, None) for closure in closures)

    def forget(self, closure: LoopClosure) -> None:
        """It was not taken: told otherwise, or later, it may be."""
        self._known.pop(closure.moments, None)

    def forget_all(self) -> None:
        """What comes is of another map."""
        self._known.clear()

    def _hear_constraint(self, message: Any) -> None:
        self._hear("constraints", message, from_msg.loop_closure)

    def _hear_whole(self, message: Any) -> None:
        if message.retracted:
            moments = self._moments.get(message.id)
            if moments is not None:
                self._withdraw(moments)
            return
        closure = self._hear("loop_closures", message, _whole)
        if closure is not None:
            self._moments[message.id] = closure.moments
            while len(self._moments) > MOST_KNOWN:
                del self._moments[next(iter(self._moments))]

    def _hear(self, topic: str, message: Any, decode: Callable[[Any], LoopClosure]) -> LoopClosure | None:
        closure = self._door.read_aside(topic, decode, message)
        if closure is None:
            stamp_ns = from_msg.stamp_ns(message)
            self._door.accept(stamp_ns)
            self._door.drop(stamp_ns, f"malformed_{topic}")
        elif closure.moments in self._known:
            self._again(closure)
        else:
            self._known[closure.moments] = None
            while len(self._known) > MOST_KNOWN:
                del self._known[next(iter(self._known))]
            self._door.accept(closure.to_ns)
            self._take(closure)
        return closure


def _whole(message: Any) -> LoopClosure:
    from_msg.bounded(message.id, "id")
    return closures_msg.read_loop_closure(message)
