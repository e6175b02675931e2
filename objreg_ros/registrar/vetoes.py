# SPDX-License-Identifier: Apache-2.0
"""Which poses between keyframes a person has withdrawn, so that they are not found again.

A pair of keyframes says again what a veto withdrew where it is that pair, whatever its pose; and where it is of the
same two revisits and its pose agrees, carried by odometry as in `consistency`: over `REACH_M` of path at both ends
together, within the tolerance for so much path. Another pose of the same place is none of these: it may be right.
A keyframe that another registrar stores has another session after each start: it is known by its robot and stamp.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_id import Identity, identity_of
from objreg_ros.data.closures import LoopClosure, Reason
from objreg_ros.geometry import inverse
from objreg_ros.memory.veto import Stand, Veto
from objreg_ros.registrar.closure import WaitingClosure
from objreg_ros.registrar.consistency import Standpoint, Statement, agree, path_m
from objreg_ros.registration.gate.refusal import Refusal

Ends = tuple[int, int]  # the sessions of target and source
Moment = tuple[int, int]  # session and stamp

VETOED: Refusal = Reason.VETOED, "a person withdrew this constraint, or a neighbouring one whose pose agrees"


class Vetoes:
    """The ``vetoes`` that hold. What is asked of one pair does not grow with those of other sessions."""

    def __init__(self, vetoes: Iterable[Veto] = ()) -> None:
        self._known: dict[Identity, Veto] = {}
        self._stated: defaultdict[Ends, dict[Identity, Statement]] = defaultdict(dict)
        self._beside: defaultdict[Moment, dict[Identity, tuple[str, int]]] = defaultdict(dict)  # robot, stamp
        for veto in vetoes:
            self.add(veto)

    def __len__(self) -> int:
        return len(self._known)

    def __iter__(self) -> Iterator[Veto]:
        return iter(tuple(self._known.values()))

    def __contains__(self, closure: LoopClosure) -> bool:
        return identity_of(closure) in self._known

    def add(self, veto: Veto) -> None:
        """Withdraw what a veto says."""
        name = identity_of(veto.closure)
        self._known[name] = veto
        statement = _statement(veto)
        if statement is not None:
            self._stated[statement.target.session, statement.source.session][name] = statement
            for one, other in ((statement.target, statement.source), (statement.source, statement.target)):
                self._beside[one.session, one.stamp_ns][name] = other.robot, other.stamp_ns

    def remove(self, closure: LoopClosure) -> Veto | None:
        """Let a closure hold again; its veto, None where there was none."""
        name = identity_of(closure)
        for stated in self._stated.values():
            stated.pop(name, None)
        for beside in self._beside.values():
            beside.pop(name, None)
        return self._known.pop(name, None)

    def covers(self, source: Standpoint, target: Standpoint, T_target_source: Array) -> bool:
        """Whether a pose (4, 4) between keyframes at these standpoints is withdrawn."""
        there, here = target.session, source.session
        if self._names(target, source) or self._names(source, target):
            return True
        return self._say(here, there, Statement(source, target, T_target_source, 0.0, False)) or (
            here != there and self._say(there, here, Statement(target, source, inverse(T_target_source), 0.0, False))
        )

    def cover_waiting(self, waiting: WaitingClosure) -> bool:
        """As `covers`, for what waits for others to confirm it."""
        return self.covers(waiting.here, waiting.there, waiting.closure.T_from_to)

    def _names(self, one: Standpoint, other: Standpoint) -> bool:
        """Whether a pair is withdrawn whose other keyframe is known by its robot and stamp, whatever its session."""
        beside = self._beside.get((one.session, one.stamp_ns), {})
        return bool(other.robot) and (other.robot, other.stamp_ns) in beside.values()

    def _say(self, source_session: int, target_session: int, asked: Statement) -> bool:
        stated = list(self._stated.get((target_session, source_session), {}).values())
        if not stated:
            return False
        if any(_same_pair(one, asked) for one in stated):
            return True
        placed = [one for one in stated if np.isfinite(one.source.travelled + one.target.travelled)]
        return bool(placed) and bool(agree(placed, asked, np.array([path_m(one, asked) for one in placed])).any())


def _statement(veto: Veto) -> Statement | None:
    """What is withdrawn; None where the closure does not name its sessions, so that no pair can be known for it."""
    closure = veto.closure
    if closure.from_session is None or closure.to_session is None:
        return None
    target = _standpoint(closure.from_ns, closure.from_session, veto.stands[0], closure.from_robot)
    source = _standpoint(closure.to_ns, closure.to_session, veto.stands[1], closure.to_robot)
    return Statement(source, target, closure.T_from_to, 0.0, False)


def _standpoint(stamp_ns: int, session: int, stand: Stand | None, robot: str) -> Standpoint:
    """Beyond the reach of any path where it is not known where the keyframe was."""
    known = stand or Stand(np.eye(4), np.nan)
    return Standpoint(stamp_ns, session, known.T_session_camera, known.travelled, robot)


def _same_pair(one: Statement, other: Statement) -> bool:
    return (one.source.stamp_ns, one.target.stamp_ns) == (other.source.stamp_ns, other.target.stamp_ns)
