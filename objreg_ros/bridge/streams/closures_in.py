# SPDX-License-Identifier: Apache-2.0
"""How a node receives closures: on `loop_closures` of objreg_msgs, on `constraints`, or on both and each once.

Those of one robot come on topics of its own too, whose name gives the robot where the message does not. On
`constraints` the prefixes of frames give it. On a robot's topic closures of others alone are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

from nav_msgs.msg import Odometry

from objreg_ros.bridge.messages import closures_msg, from_msg, headers
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Moments, Robots, may_be_same, robot_of

MOST_KNOWN = 100_000  # closures that are remembered, so that none is taken twice


class ClosuresIn:
    """The counters of ``node`` count closures. ValueError for `loop_closures` where objreg_msgs is not installed.

    ``take`` is given each accepted closure, ``again`` a known one that now names its sessions, ``withdraw`` the
    `Moments` and robots of a retracted one, which is taken again when its id comes again. `forget_closure` lets a
    closure come once more. ``prefixes`` has what precedes the topics of each robot.
    """

    def __init__(
        self,
        node: NodeBase,
        topic: str,
        take: Callable[[LoopClosure], None],
        again: Callable[[LoopClosure], None],
        withdraw: Callable[[Moments, Robots], None],
        prefixes: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._node, self._take, self._again, self._withdraw = node, take, again, withdraw
        self._robots = [robot for robot in prefixes if robot]
        self._known: dict[Moments, set[Robots]] = {}  # the oldest first
        self._by_id: dict[str, tuple[Moments, Robots]] = {}  # the id is that of objreg_msgs
        self._retracted = set[str]()  # ids of these
        whole, kept = closures_msg.LoopClosureMsg, qos.latched(qos.KEPT_CONSTRAINTS)
        if topic == "loop_closures" and whole is None:
            raise ValueError("input: expected objreg_msgs, got none: build it with colcon, or set input:=constraints")
        for robot, prefix in {"": "", **prefixes}.items():
            if topic != "constraints" and whole is not None:
                node.listen(whole, f"{prefix}loop_closures", partial(self._on_whole, robot=robot), kept)
            if topic != "loop_closures":
                node.listen(Odometry, f"{prefix}constraints", partial(self._on_constraint, robot=robot), kept)

    def know(self, closures: Iterable[LoopClosure]) -> None:
        """These were taken before."""
        for closure in closures:
            self._by_id.setdefault(closure_id(closure), (closure.moments, closure.robots))
            self._known.setdefault(closure.moments, set()).add(closure.robots)

    def forget_closure(self, closure: LoopClosure) -> None:
        """The closure was not taken: in another form, or later, it may be."""
        left = self._known.pop(closure.moments, set()) - {closure.robots}
        if left:
            self._known[closure.moments] = left

    def forget_all(self) -> None:
        """What comes is of another map."""
        self._known.clear()

    def _on_constraint(self, message: Any, robot: str = "") -> None:
        self._receive(
            "constraints", message, lambda sent: self._of(robot, self._by_frames(from_msg.loop_closure(sent)))
        )

    def _by_frames(self, closure: LoopClosure) -> LoopClosure:
        """The closure of the robots whose prefixes its frames have."""
        frames = closure.from_frame_id, closure.to_frame_id
        one, other = (robot_of(frame_id, self._robots) for frame_id in frames)
        return replace(closure, from_robot=one, to_robot=other)

    def _of(self, robot: str, closure: LoopClosure) -> LoopClosure:
        """The closure, of the robot of its topic where it names none itself. ValueError where it is of others only, or
        a frame has the prefix of another robot: nobody speaks for others.
        """
        one, other = closure.robots
        named = replace(closure, from_robot=one or robot, to_robot=other or robot)
        if robot and robot not in named.robots:
            raise ValueError(f"closure: expected one of {robot!r}, whose topic it is, got one of {named.robots}")
        for name, frame_id in zip(named.robots, (closure.from_frame_id, closure.to_frame_id), strict=True):
            if (owner := robot_of(frame_id, self._robots)) not in ("", name) and name:
                raise ValueError(f"closure: expected a frame of {name!r}, got {frame_id!r}, which is of {owner!r}")
        return named

    def _on_whole(self, message: Any, robot: str = "") -> None:
        if message.retracted:
            closed = self._by_id.get(message.id)
            if closed is not None and (not robot or robot in closed[1] or "" in closed[1]):
                self._retracted.add(message.id)
                self._withdraw(*closed)
            return
        if message.id in self._retracted:
            self._retracted.discard(message.id)
            moments, robots = self._by_id[message.id]
            self._known.get(moments, set()).discard(robots)
        closure = self._receive("loop_closures", message, lambda sent: self._of(robot, _whole(sent)))
        if closure is not None:
            self._by_id[message.id] = closure.moments, closure.robots
            while len(self._by_id) > MOST_KNOWN:
                self._retracted.discard(oldest := next(iter(self._by_id)))
                del self._by_id[oldest]

    def _is_known(self, closure: LoopClosure) -> bool:
        return any(may_be_same(closure.robots, robots) for robots in self._known.get(closure.moments, ()))

    def _receive(self, topic: str, message: Any, decode: Callable[[Any], LoopClosure]) -> LoopClosure | None:
        closure = self._node.read_aside(topic, decode, message)
        if closure is None:
            stamp_ns = headers.stamp_ns(message)
            self._node.accept(stamp_ns)
            self._node.drop(stamp_ns, f"malformed_{topic}")
        elif self._is_known(closure):
            self._again(closure)
        else:
            self.know([closure])
            while len(self._known) > MOST_KNOWN:
                del self._known[next(iter(self._known))]
            self._node.accept(closure.to_ns)
            self._take(closure)
        return closure


def _whole(message: Any) -> LoopClosure:
    headers.bounded(message.id, "id")
    return closures_msg.read_loop_closure(message)
