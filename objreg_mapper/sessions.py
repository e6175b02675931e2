# SPDX-License-Identifier: Apache-2.0
"""The sessions of a graph, of all its robots: in which of them odometry goes on, and which one a stamp is of."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

from objreg_mapper.session import Session
from objreg_ros.data.closures import LoopClosure


class StampedFrame(NamedTuple):
    """An end of a closure: ``robot`` is empty and ``session`` None where they are not given."""

    robot: str
    session: int | None
    stamp_ns: int


def moments_of(closure: LoopClosure) -> tuple[StampedFrame, StampedFrame]:
    """Those of *from* and of *to*."""
    return (
        StampedFrame(closure.from_robot, closure.from_session, closure.from_ns),
        StampedFrame(closure.to_robot, closure.to_session, closure.to_ns),
    )


class Sessions(list[Session]):
    """In the order in which they began. One of which no odometry came yet is the last, and the next replaces it.

    Robots drive at once by clocks that may agree, so a moment is looked for among the sessions of its
    robot: among all where it names none, and in those of an odometry that has no name.
    """

    def begin_session(self, name: int | None = None, robot: str = "") -> None:
        """Odometry of a robot is of another run from now on."""
        if self and len(self[-1].keyframes) == 0:
            self.pop()
        self.append(Session(robot))
        self.learn(len(self) - 1, name)

    def learn(self, session: int, name: int | None) -> None:
        """What closures call a session; None names nothing."""
        if name is not None:
            self[session].names.add(name)

    def learn_from(self, closure: LoopClosure) -> None:
        """Take the names of sessions from a closure that is known without them."""
        for moment in moments_of(closure):
            with suppress(ValueError):
                session = self.of(moment)
                if session is not None:
                    self.learn(session, moment.session)

    def newest(self, robot: str) -> int | None:
        """The session in which the odometry of a robot goes on; None before it begins."""
        return next((k for k in reversed(range(len(self))) if self[k].robot == robot and not self[k].is_over), None)

    def of(self, moment: StampedFrame) -> int | None:
        """The session that has a moment: the one that does, and of several the one of this name.

        None where none has it yet. ValueError where two may, and nothing says which is meant.
        """
        name, may_come = moment.session, self._may_come(moment)
        covering = self._covering(moment)
        named = [k for k in covering if name in self[k].names]
        if len(named) == 1 or (len(covering) == 1 and not may_come):
            return (named or covering)[0]
        if name is not None and covering and may_come:
            return None  # of the run that goes on, once it is there
        nameless = [k for k in covering if not self[k].names]
        if name is not None and len(nameless) == 1:
            return nameless[0]
        if covering:
            raise ValueError(
                f"expected a constraint that names its sessions, as {max(len(covering), 2)} runs of odometry have the "
                f"stamp {moment.stamp_ns} ns, got one without; objreg_msgs/LoopClosure names them and the robots"
            )
        return None

    def in_gap(self, moment: StampedFrame) -> bool:
        """Whether a moment lies in a gap of the odometry that goes on, so that no session will ever have it."""
        on = self._going_on(moment.robot)
        return self._is_lost(moment) and any(self[k].odometry.in_gap(moment.stamp_ns) for k in on)

    def is_before_odometry(self, moment: StampedFrame) -> bool:
        """Whether odometry began after a moment that no session has: it will never be covered."""
        return self._is_lost(moment) and not self.in_gap(moment)

    def _is_lost(self, moment: StampedFrame) -> bool:
        on = [self[k].odometry for k in self._going_on(moment.robot)]
        past = all(one.in_gap(moment.stamp_ns) or (one.stamps_ns and moment.stamp_ns < one.stamps_ns[0]) for one in on)
        return bool(on) and past and not self._covering(moment)

    def _may_come(self, moment: StampedFrame) -> bool:
        """Whether odometry that goes on, or is about to, has yet to come to a moment."""
        on = self._going_on(moment.robot)
        return not on or any(self[k].is_ahead(moment.stamp_ns) for k in on)

    def _covering(self, moment: StampedFrame) -> list[int]:
        return [k for k in self._those_of(moment.robot) if self[k].covers(moment.stamp_ns)]

    def _going_on(self, robot: str) -> list[int]:
        found = (self.newest(other) for other in {self[k].robot for k in self._those_of(robot)})
        return [k for k in found if k is not None]

    def _those_of(self, robot: str) -> list[int]:
        return [k for k, one in enumerate(self) if not robot or one.robot in (robot, "")]
