# SPDX-License-Identifier: Apache-2.0
"""A queue of closures that wait for odometry at both their stamps, and the outcome of each closure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from objreg_mapper.closure_constraint import ImplausibleError
from objreg_mapper.follower import Followers
from objreg_mapper.pose_graph import PoseGraph, UnknownRobotError
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry

FindMount = Callable[[Sequence[Odometry], str], Array | None]  # T_body_camera by odometry of the body, and the frame


class Fate(NamedTuple):
    """The outcome of a closure: added to the graph, or refused for a ``reason``, with ``text`` for the log."""

    closure: LoopClosure
    reason: str = ""
    text: str = ""


class ClosureQueue:
    """At most ``most`` closures that wait for odometry, the oldest first. Odometry may come before or after them."""

    def __init__(self, followers: Followers, find_mount: FindMount, most: int) -> None:
        self.closures: list[LoopClosure] = []
        self.most = most
        self._followers, self._find_mount = followers, find_mount

    def take_out(self, is_meant: Callable[[LoopClosure], bool] = lambda _: True) -> list[LoopClosure]:
        """Remove the closures for which ``is_meant`` is true from the queue, all by default, and return them."""
        out = [closure for closure in self.closures if is_meant(closure)]
        self.closures = [closure for closure in self.closures if not is_meant(closure)]
        return out

    def tie(self, graph: PoseGraph) -> list[Fate]:
        """Add the closures to the graph whose odometry is known. Returns the outcomes of all that leave the queue.

        A closure also leaves the queue if its odometry can no longer come, or if the queue is full.
        """
        fates = []
        for closure in self.take_out():
            fate = self._fate(graph, closure)
            fates += [] if fate is None else [fate]
            self.closures += [closure] if fate is None else []
        while len(self.closures) > self.most:
            text = "no odometry covers the keyframes of the constraint"
            fates.append(Fate(self.closures.pop(0), "queue_full", text))
        return fates

    def _fate(self, graph: PoseGraph, closure: LoopClosure) -> Fate | None:
        """The outcome of one closure, which is added to the graph if it can be; None if it must wait longer."""
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
        """The reasons why odometry of a closure can no longer come, each with its explanation."""
        if graph.in_gap(closure):
            yield "odometry_gap", "no odometry came around a keyframe of the constraint"
        if graph.is_before_odometry(closure):
            yield "before_odometry", "odometry begins after the first keyframe of the constraint"
        if all(one.is_of_old_run(closure.to_ns) for one in self._followers.meant(closure.to_robot)):
            yield "time_jump", "it was found before time jumped back, and came after that"

    def _refuse_unknown(self, graph: PoseGraph, closure: LoopClosure) -> None:
        """`UnknownRobotError` if a closure names a robot of which the mapper has neither odometry nor a session."""
        known = {*self._followers, *(session.robot for session in graph.sessions)}
        unknown = set(closure.robots) - known - {""}
        if unknown and "" not in known:
            expected, got = ", ".join(sorted(known)), ", ".join(sorted(unknown))
            raise UnknownRobotError(f"expected robots of {expected}, got {got}; the parameter robots names them")

    def _T_body_camera(self, robot: str, frame_id: str) -> Array | None:
        """The mount of a camera on the body of a robot; None if it is not known.

        If the body frame of the odometry lacks the robot's prefix, the frames on /tf lack it too, and the camera is
        looked up without the prefix.
        """
        newest = [one.newest for one in self._followers.meant(robot) if one.newest is not None]
        is_bare = robot and not any(one.child_frame_id.startswith(f"{robot}/") for one in newest)
        return self._find_mount(newest, frame_id.removeprefix(f"{robot}/") if is_bare else frame_id)


def _named(closure: LoopClosure) -> str:
    return f"the constraint from {closure.from_ns} to {closure.to_ns} ns"
