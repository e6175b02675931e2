# SPDX-License-Identifier: Apache-2.0
"""Closures whose moments odometry has yet to come to, and what becomes of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from objreg_ros.data import Array, LoopClosure, Odometry
from objreg_ros.mapper.follower import Followers
from objreg_ros.mapper.pose_graph import ImplausibleError, PoseGraph, UnknownRobotError

FindMount = Callable[[Sequence[Odometry], str], Array | None]  # T_body_camera by odometry of the body, and the frame


class Fate(NamedTuple):
    """A closure that waits no more: it is tied, or refused for a ``reason``."""

    closure: LoopClosure
    reason: str = ""
    words: str = ""


class Waiting:
    """At most ``most`` closures, the oldest first: odometry and closures come in any order."""

    def __init__(self, followers: Followers, find_mount: FindMount, most: int) -> None:
        self.closures: list[LoopClosure] = []
        self.most = most
        self._followers, self._find_mount = followers, find_mount

    def take_out(self, is_meant: Callable[[LoopClosure], bool] = lambda _: True) -> list[LoopClosure]:
        """Those that are meant, which wait no more; all of them without a question."""
        out = [closure for closure in self.closures if is_meant(closure)]
        self.closures = [closure for closure in self.closures if not is_meant(closure)]
        return out

    def tie(self, graph: PoseGraph) -> list[Fate]:
        """Tie those whose odometry is there; what became of them and of those of which nothing can become any more."""
        fates = []
        for closure in self.take_out():
            fate = self._fate(graph, closure)
            fates += [] if fate is None else [fate]
            self.closures += [closure] if fate is None else []
        while len(self.closures) > self.most:
            words = "no odometry covers the moments of the constraint"
            fates.append(Fate(self.closures.pop(0), "queue_full", words))
        return fates

    def _fate(self, graph: PoseGraph, closure: LoopClosure) -> Fate | None:
        """None for one that goes on waiting."""
        refused = partial(Fate, closure)
        try:
            self._refuse_unknown(graph, closure)
            if graph.add_closure(closure, self._T_body_camera):
                return refused()
        except ImplausibleError as error:
            return refused("implausible", f"{_named(closure)}: {error}")
        except UnknownRobotError as error:
            return refused("unknown_robot", f"{_named(closure)}: {error}")
        except ValueError as error:
            return refused("two_clocks", str(error))
        return next((refused(*why) for why in self._why_never(graph, closure)), None)

    def _why_never(self, graph: PoseGraph, closure: LoopClosure) -> Iterator[tuple[str, str]]:
        if graph.in_gap(closure):
            yield "odometry_gap", "no odometry came around a moment of the constraint"
        if graph.is_before_odometry(closure):
            yield "before_odometry", "odometry begins after the first moment of the constraint"
        if all(one.is_of_old_run(closure.to_ns) for one in self._followers.meant(closure.to_robot)):
            yield "time_jump", "it was found before time jumped back, and came after that"

    def _refuse_unknown(self, graph: PoseGraph, closure: LoopClosure) -> None:
        known = {*self._followers, *(session.robot for session in graph.sessions)}
        unknown = set(closure.robots) - known - {""}
        if unknown and "" not in known:
            expected, got = ", ".join(sorted(known)), ", ".join(sorted(unknown))
            raise UnknownRobotError(f"expected robots of {expected}, got {got}; the parameter robots names them")

    def _T_body_camera(self, robot: str, frame_id: str) -> Array | None:
        """By a frame without the robot's prefix where the odometry's body has none: then it has none on /tf either."""
        words = [one.newest for one in self._followers.meant(robot) if one.newest is not None]
        is_bare = robot and not any(word.child_frame_id.startswith(f"{robot}/") for word in words)
        return self._find_mount(words, frame_id.removeprefix(f"{robot}/") if is_bare else frame_id)


def _named(closure: LoopClosure) -> str:
    return f"the constraint from {closure.from_ns} to {closure.to_ns} ns"
