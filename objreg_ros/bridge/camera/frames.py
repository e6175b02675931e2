# SPDX-License-Identifier: Apache-2.0
"""Where the parts of a robot sit on each other, by /tf_static and /tf: the little of tf2 that is needed here.

Reads attributes only, so the messages of rclpy and of rosbags (tf2_msgs/TFMessage of ROS 1 and 2) both fit.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass, field
from enum import IntEnum
from threading import Lock
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.messages import headers
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import JUMP_NS
from objreg_ros.geometry import interpolate, inverse, pose, rotation_from_quaternion

MOST_FRAMES = 10_000  # what says more is no robot
MOST_DEEP = 100  # frames between the root and a frame that is followed; bounds what their histories hold
HISTORY_NS = 30_000_000_000  # of an edge that moves, kept behind its newest sample
MOST_SAMPLES = 6000  # of an edge: 30 s at 200 Hz
GAP_NS = 1_000_000_000  # two samples farther apart do not say what was between them
END_NS = 200_000_000  # so far beside a sample an edge still is where it was
STILL = 1e-6  # m, or a part of a quaternion: numbers that are repeated differ by less

# Frames that carry no part of a robot: they attach nothing to a body.
WORLD = re.compile(
    r"(^|[/_])(map\d*|odom\w*|world|earth|global|local_origin|utm|init|ground_?truth|gt|vicon|mocap|optitrack|vrpn"
    r"|qualisys|motion_?capture)([/_]|$)",
    re.IGNORECASE,
)


class FrameTie(IntEnum):
    """How it is known where two frames are on each other; of a chain the largest of its edges'."""

    STATIC = 0  # by /tf_static
    CONSTANT = 1  # by /tf, which repeats the same
    MOVING = 2  # by /tf, which follows a joint


Sample = tuple[float, ...]  # x y z qx qy qz qw


@dataclass(slots=True)
class FrameEdge:
    """A frame in its parent. ``fixed (4, 4)`` is by /tf_static; else ``first`` and the history are by /tf."""

    parent: str
    child: str
    fixed: Array | None = None
    first: Sample = ()
    moves: bool = False
    extent: float = 0.0  # m, the farthest that the child was seen from where it was first
    stamps_ns: list[int] = field(default_factory=list)
    samples: list[Sample] = field(default_factory=list)

    @property
    def tie(self) -> FrameTie:
        """How the edge is known."""
        if self.fixed is not None:
            return FrameTie.STATIC
        return FrameTie.MOVING if self.moves else FrameTie.CONSTANT

    def add_sample(self, stamp_ns: int, sample: Sample) -> None:
        """Another sample. One that is not newer is left out; time that jumps back begins the history anew."""
        if not self.first:
            self.first = sample
        if self.stamps_ns and stamp_ns <= self.stamps_ns[-1]:
            if self.stamps_ns[-1] - stamp_ns < JUMP_NS:
                return
            self.stamps_ns.clear()
            self.samples.clear()
        self.stamps_ns.append(stamp_ns)
        self.samples.append(sample)
        if sample != self.first:
            self._note_motion(sample)
        if len(self.stamps_ns) > MOST_SAMPLES or self.stamps_ns[0] < stamp_ns - HISTORY_NS:
            gone = max(len(self.stamps_ns) - MOST_SAMPLES, bisect_left(self.stamps_ns, stamp_ns - HISTORY_NS))
            del self.stamps_ns[:gone], self.samples[:gone]

    def _note_motion(self, sample: Sample) -> None:
        same, other = _apart(sample, self.first)
        self.moves = self.moves or max(same, other) > STILL
        self.extent = max(self.extent, same)

    def at(self, stamp_ns: int | None) -> Array | None:
        """``T_parent_child (4, 4)`` at a time; None of an edge that moves where its history does not reach."""
        if self.fixed is not None:
            return self.fixed
        if not self.moves:
            return _pose(self.first)
        return None if stamp_ns is None else self._in_history(stamp_ns)

    def _in_history(self, stamp_ns: int) -> Array | None:
        after = bisect_left(self.stamps_ns, stamp_ns)
        near = range(max(0, after - 1), min(len(self.stamps_ns), after + 1))
        if len(near) == 2 and self.stamps_ns[after] - self.stamps_ns[after - 1] <= GAP_NS:
            begin, end = (self.stamps_ns[k] for k in near)
            T_begin, T_end = (_pose(self.samples[k]) for k in near)
            return interpolate(T_begin, T_end, (stamp_ns - begin) / (end - begin))
        nearest = min(near, key=lambda k: abs(self.stamps_ns[k] - stamp_ns), default=None)
        if nearest is None or abs(self.stamps_ns[nearest] - stamp_ns) > END_NS:
            return None
        return _pose(self.samples[nearest])


class FrameTree:
    """Frames with their poses in their parents. One thread may add to it while another one asks.

    A child may have several parents: /tf of a robot in a motion-capture room has odometry and the truth of one body.
    The chain above a frame goes by /tf_static first, then by what is no world. Only the chains above frames that were
    asked for have a history; of the others just the parents are kept, so that a busy /tf costs little.
    """

    def __init__(self) -> None:
        self._edges: dict[str, dict[str, FrameEdge]] = {}
        self._count = 0
        self._asked: set[str] = set()
        self._followed: set[str] = set()  # children whose edges have a history
        self._lock = Lock()

    def add_transforms(self, message: Any) -> None:
        """Take a TFMessage of /tf_static in: the last transform of a frame counts.

        ValueError for a transform without a rotation, or beyond all measure; the others are taken.
        """
        self._take(message, self._take_static)

    def receive_moving(self, message: Any) -> None:
        """Take a TFMessage of /tf in, as `add_transforms`. What /tf_static said of a frame and its parent stays."""
        self._take(message, self._take_moving)

    def _take(self, message: Any, take: Any) -> None:
        wrong: ValueError | None = None
        with self._lock:
            for one in message.transforms:
                try:
                    take(one, one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/"))
                except ValueError as error:
                    wrong = wrong or error
        if wrong is not None:
            raise wrong

    def _take_static(self, one: Any, parent: str, child: str) -> None:
        T_parent_child = _pose(_sample(one, parent, child))
        edge = self._edge(parent, child)
        others = [other for other in self._edges[child].values() if other.fixed is not None and other is not edge]
        for other in others:
            del self._edges[child][other.parent]
            self._count -= 1
        edge.fixed = T_parent_child
        self._follow()

    def _take_moving(self, one: Any, parent: str, child: str) -> None:
        edge = self._edges.get(child, {}).get(parent)
        if edge is not None and (edge.fixed is not None or child not in self._followed):
            return
        sample = _sample(one, parent, child)
        stamp_ns = headers.stamp_ns(one)
        if edge is None:
            edge = self._edge(parent, child)
            self._follow()
        edge.add_sample(stamp_ns, sample)

    def _edge(self, parent: str, child: str) -> FrameEdge:
        parents = self._edges.get(child, {})
        if parent not in parents and self._count >= MOST_FRAMES:
            raise ValueError(f"tf: expected at most {MOST_FRAMES} frames, got another one, {child}")
        if parent not in parents:
            self._edges.setdefault(child, parents)[parent] = FrameEdge(parent, child)
            self._count += 1
        return parents[parent]

    def keep_history(self, *names: str) -> None:
        """Keep a history of what is above these frames from now on."""
        with self._lock:
            self._ask(names)

    def _ask(self, names: tuple[str, ...]) -> None:
        new = [name for name in names if name and name not in self._asked]
        if new and len(self._asked) < MOST_FRAMES:
            self._asked.update(new)
            self._follow()

    def _follow(self) -> None:
        self._followed = {edge.child for name in self._asked for edge in self._chain(name)}

    def _chain(self, name: str) -> list[FrameEdge]:
        """The edges above a frame, the lowest first; a ring of frames is gone round once."""
        chain: list[FrameEdge] = []
        passed = {name}
        while name in self._edges and len(chain) < MOST_DEEP:
            edge = min(self._edges[name].values(), key=_preference)
            chain.append(edge)
            name = edge.parent
            if name in passed:
                break
            passed.add(name)
        return chain

    def above(self, name: str) -> list[list[FrameEdge]]:
        """The edges above a frame, the lowest first: of each frame on the chain those to all its parents.

        The first of several is the one by which the chain goes on.
        """
        with self._lock:
            self._ask((name,))
            return [sorted(self._edges[edge.child].values(), key=_preference) for edge in self._chain(name)]

    def names(self) -> set[str]:
        """Every frame."""
        with self._lock:
            return {*self._edges, *(parent for parents in self._edges.values() for parent in parents)}

    def between(self, a: str, b: str, stamp_ns: int | None = None, without: str = "") -> Array | None:
        """``T_a_b (4, 4)`` at a time; without one only where no edge between them moves.

        None where nothing ties the two frames together but a world (`WORLD`) or the frame ``without``, and where a
        history does not reach.
        """
        with self._lock:
            self._ask((a, b))
            path = self._path(a, b, without)
            if path is None:
                return None
            T_top_a, T_top_b = (_product(edges, stamp_ns) for edges in path)
        return None if T_top_a is None or T_top_b is None else inverse(T_top_a) @ T_top_b

    def tie(self, a: str, b: str, without: str = "") -> FrameTie | None:
        """How it is known where two frames are on each other; None where nothing ties them, as in `between`."""
        with self._lock:
            self._ask((a, b))
            path = self._path(a, b, without)
            return (
                None if path is None else max((edge.tie for edges in path for edge in edges), default=FrameTie.STATIC)
            )

    def reached_ns(self, a: str, b: str) -> int | None:
        """Until when every edge between two frames that moves is known; None where none moves."""
        with self._lock:
            moving = [edge for edges in self._path(a, b) or () for edge in edges if edge.tie is FrameTie.MOVING]
            return min((edge.stamps_ns[-1] for edge in moving if edge.stamps_ns), default=None)

    def _path(self, a: str, b: str, without: str = "") -> tuple[list[FrameEdge], list[FrameEdge]] | None:
        """The edges above either frame up to the one that both share; None where that takes what carries neither."""
        of_a, of_b = self._chain(a), self._chain(b)
        names_a, names_b = ([name, *(edge.parent for edge in of)] for name, of in ((a, of_a), (b, of_b)))
        shared = next((name for name in names_b if name in names_a), None)
        if shared is None:
            return None
        up, down = names_a.index(shared), names_b.index(shared)
        between = {*names_a[: up + 1], *names_b[: down + 1]} - {a, b}
        return None if any(name == without or is_world(name) for name in between) else (of_a[:up], of_b[:down])


def _preference(edge: FrameEdge) -> tuple[bool, bool, bool]:
    """By which of its parents a frame is asked for, the least first; of equals the one that was there first."""
    world = is_world(edge.parent)
    return edge.fixed is None, world, world and "odom" not in edge.parent.lower()


def _product(edges: list[FrameEdge], stamp_ns: int | None) -> Array | None:
    T_top_bottom = np.eye(4)
    for edge in edges:
        T_parent_child = edge.at(stamp_ns)
        if T_parent_child is None:
            return None
        T_top_bottom = T_parent_child @ T_top_bottom
    return T_top_bottom


def _sample(one: Any, parent: str, child: str) -> Sample:
    """The numbers of a transform; ValueError for names too long, no rotation, and what is beyond all measure."""
    for name in (parent, child):
        headers.bounded(name, "tf")
    where, turn = one.transform.translation, one.transform.rotation
    sample = float(where.x), float(where.y), float(where.z), float(turn.x), float(turn.y), float(turn.z), float(turn.w)
    if not all(abs(metres) <= limits.MOST_DISTANCE for metres in sample[:3]):
        raise ValueError(f"tf: expected {child} within {limits.MOST_DISTANCE:g} m, got {list(sample[:3])}")
    if not 1e-9 <= sum(part * part for part in sample[3:]) ** 0.5 < float("inf"):
        raise ValueError(f"tf: expected a quaternion of non-zero length for {child}, got {list(sample[3:])}")
    return sample


def _pose(sample: Sample) -> Array:
    return pose(rotation_from_quaternion(np.array(sample[3:])), np.array(sample[:3]))


def _apart(a: Sample, b: Sample) -> tuple[float, float]:
    """How far two samples are apart: in metres, and in the parts of a quaternion, whose sign says nothing."""
    metres = sum((p - q) ** 2 for p, q in zip(a[:3], b[:3], strict=True)) ** 0.5
    sign = 1.0 if sum(p * q for p, q in zip(a[3:], b[3:], strict=True)) >= 0 else -1.0
    return metres, max(abs(p - sign * q) for p, q in zip(a[3:], b[3:], strict=True))


def is_world(name: str) -> bool:
    """Whether a frame of this name carries no part of a robot, as a map and odometry do."""
    return WORLD.search(name) is not None
