# SPDX-License-Identifier: Apache-2.0
"""How often a camera came back to a place, by the constraints of a run; it needs no truth.

A constraint closes a revisit where the camera had left the place between its two keyframes, else both are of one stay.
Its place are the objects that both keyframes have in their pictures. It is left while less than a quarter of these lie
in the picture, for a second at least, by odometry or by our own tracking; by the truth where that covers every frame.
Drift moves a place: it counts as seen where either keyframe says so. Where no pose is known, the labels of the place
must be absent from all detections for three seconds; what neither shows is not known.

A revisit is a stretch of time in which the camera is again at places that it had left, whatever they are tied to: the
later ends of its constraints follow each other within five seconds, or the camera did not leave between them. So ten
constraints of one return are one revisit, and a loop that is walked a second time is one, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, tan

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, transform
from objreg_tools.report.run.rows import Glimpse
from objreg_tools.report.words import number_of
from objreg_tools.truth import Truth

STRETCH_NS = 5_000_000_000  # later ends that are nearer in time are of one revisit
AWAY_NS = 1_000_000_000  # a place that the picture lacks for less was not left
UNSEEN_NS = 3_000_000_000  # the same where detections alone show it: a detector misses an object for a while
SEEN_SHARE = 0.25  # of the objects of a place, as the overlap of a revisit by truth
REACH_M = 5.0  # farther objects are not seen: cameras measure, and detectors find, less far
FIELD_DEG = (70.0, 55.0)  # a camera's field of view where a run does not state it; wide, so that less counts as left
AHEAD_M = 1.5  # where a place is that showed no object

Field = tuple[float, float]  # the width and the height of a picture, degrees


@dataclass(frozen=True, slots=True)
class ClosedRevisits:
    """The constraints of a run by what they close, as indices.

    ``revisits`` are those of each revisit, in the order of time; ``stayed`` those of keyframes between which the camera
    did not leave; ``unknown`` those where that is not known.
    """

    revisits: tuple[tuple[int, ...], ...] = ()
    stayed: tuple[int, ...] = ()
    unknown: tuple[int, ...] = ()

    @classmethod
    def of(cls, closures: Sequence[LoopClosure], walk: Walk) -> ClosedRevisits:
        """What the constraints of a walk close."""
        left = [walk.left(closure) for closure in closures]
        return cls(
            _stretches([k for k, was_left in enumerate(left) if was_left], closures, walk),
            tuple(k for k, was_left in enumerate(left) if was_left is False),
            tuple(k for k, was_left in enumerate(left) if was_left is None),
        )

    @property
    def count(self) -> int | None:
        """How many revisits the constraints close; None where they show none, and of some it is not known."""
        return len(self.revisits) if self.revisits or not self.unknown else None

    @property
    def closing(self) -> int:
        """How many constraints close a revisit."""
        return sum(map(len, self.revisits))

    @property
    def text(self) -> str:
        """The counts in words; empty without constraints."""
        if not self.revisits:
            return self._text_without_revisits()
        text = f"{number_of(len(self.revisits), 'revisit')}, closed by {number_of(self.closing, 'constraint')}"
        others = [f"{len(self.stayed)} more within one stay"] if self.stayed else []
        others += [f"of {len(self.unknown)} more it is not known"] if self.unknown else []
        return f"{text} ({', '.join(others)})" if others else text

    def _text_without_revisits(self) -> str:
        if self.unknown:
            count = number_of(len(self.unknown) + len(self.stayed), "constraint")
            return f"{count}, and it is not known whether the camera had left between their keyframes"
        if not self.stayed:
            return ""
        count = number_of(len(self.stayed), "constraint")
        return f"the camera never left: {count} between keyframes of one place, 0 revisits"


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """A keyframe's frame: its index, what it saw ``xyz (N, 3)`` m in its camera, and the labels detected."""

    stamp_ns: int
    index: int
    xyz: Array
    labels: frozenset[str]


class Walk:
    """Where the camera was, and what it saw there; by the ``truth`` if that covers every frame."""

    def __init__(
        self, glimpses: Sequence[Glimpse], by_tracking: bool, field_deg: Field = FIELD_DEG, truth: Truth | None = None
    ) -> None:
        self._glimpses = sorted(glimpses, key=lambda glimpse: glimpse.stamp_ns)
        self._stamps_ns = np.array([glimpse.stamp_ns for glimpse in self._glimpses], np.int64)
        poses = _poses(self._glimpses, by_tracking, truth)
        self._sessions = np.array([-1 if pose is None else pose[0] for pose in poses])
        self._poses = np.array([np.eye(4) if pose is None else pose[1] for pose in poses]).reshape(-1, 4, 4)
        self._tangents = np.array([tan(radians(degrees) / 2) for degrees in field_deg])

    def left(self, closure: LoopClosure) -> bool | None:
        """Whether the camera left the place of a constraint between its keyframes; None where that is not known.

        Another camera's keyframe, or one of before the run, is of no stay of this one.
        """
        if closure.from_robot != closure.to_robot or closure.from_frame_id != closure.to_frame_id:
            return True
        first_ns = min(closure.from_ns, closure.to_ns)
        if len(self._glimpses) and first_ns < self._stamps_ns[0] - AWAY_NS:
            return True
        ends = self._end(closure.from_ns), self._end(closure.to_ns)
        places = self._common(*ends, closure.T_from_to), self._common(*ends[::-1], inverse(closure.T_from_to))
        return self._left(*sorted(zip(ends, places, strict=True), key=lambda end: end[0].stamp_ns))

    def left_between(self, first_ns: int, last_ns: int) -> bool | None:
        """Whether the camera left what it saw at both times, in between; None where that is not known."""
        ends = self._end(first_ns), self._end(last_ns)
        return self._left(*((end, end.xyz) for end in ends))

    def _left(self, first: tuple[_End, Array], last: tuple[_End, Array]) -> bool | None:
        between = np.arange(first[0].index + 1, last[0].index)
        if len(between) == 0:
            return None if last[0].stamp_ns - first[0].stamp_ns > AWAY_NS else False
        known, seen = self._by_poses((first, last), between)
        absent = np.where(known, ~seen, ~self._by_labels((first[0], last[0]), between))
        stamps_ns = self._stamps_ns[between]
        if _longest(absent & known, stamps_ns) >= AWAY_NS or _longest(absent, stamps_ns) >= UNSEEN_NS:
            return True
        return False if known.all() else None

    def _end(self, stamp_ns: int) -> _End:
        """The frame of a keyframe; without frames one that saw nothing."""
        if not self._glimpses:
            return _End(stamp_ns, 0, np.zeros((0, 3)), frozenset())
        index = int(np.abs(self._stamps_ns - stamp_ns).argmin())
        xyz = [at for _, at in self._glimpses[index].objects] or [np.array([0.0, 0.0, AHEAD_M])]
        return _End(stamp_ns, index, np.array(xyz), frozenset(self._glimpses[index].labels))

    def _common(self, end: _End, other: _End, T_end_other: Array) -> Array:
        """Where at an end the objects are that both ends have in their pictures (N, 3); all of it without any."""
        both = np.concatenate([end.xyz, transform(T_end_other, other.xyz)])
        common = both[self._inside(both) & self._inside(transform(inverse(T_end_other), both))]
        return common if len(common) else end.xyz

    def _by_poses(self, ends: Sequence[tuple[_End, Array]], between: Array) -> tuple[Array, Array]:
        """Of the frames ``between`` (N,): whether a pose relates them to an end, and whether they see its place."""
        known, seen = np.zeros(len(between), bool), np.zeros(len(between), bool)
        for end, place in ends:
            session, T_session_end = self._sessions[end.index], self._poses[end.index]
            tied = (self._sessions[between] == session) & (session >= 0)
            known |= tied
            views = [self._is_seen(place, inverse(self._poses[k]) @ T_session_end) for k in between[tied]]
            seen[tied] |= np.array(views, bool)
        return known, seen

    def _is_seen(self, place: Array, T_camera_end: Array) -> bool:
        """Whether a quarter of a place (N, 3) at an end, or more, lies in the picture of a camera."""
        return len(place) > 0 and bool(self._inside(transform(T_camera_end, place)).mean() >= SEEN_SHARE)

    def _inside(self, xyz: Array) -> Array:
        """Which points (N, 3) of a camera's frame lie in its picture, near enough to be seen."""
        x, y, z = xyz.T
        ahead = (z > 0.0) & (z < REACH_M)
        return ahead & (np.abs(x) <= z * self._tangents[0]) & (np.abs(y) <= z * self._tangents[1])

    def _by_labels(self, ends: Sequence[_End], between: Array) -> Array:
        """Of the frames (N,): whether a label of the place was detected; True where the place has none."""
        place = frozenset[str]().union(*(end.labels for end in ends))
        return np.array([not place or bool(place.intersection(self._glimpses[k].labels)) for k in between])


def _poses(glimpses: Sequence[Glimpse], by_tracking: bool, truth: Truth | None) -> list[tuple[int, Array] | None]:
    """The session and the pose of each frame, None where neither odometry nor tracking knows it."""
    true = [None if truth is None else truth.at(glimpse.stamp_ns) for glimpse in glimpses]
    whole = [(0, T) for T in true if T is not None]
    if len(whole) == len(glimpses):
        return list(whole)
    return [glimpse.pose(by_tracking) or glimpse.tracked for glimpse in glimpses]


def _longest(holds: Array, stamps_ns: Array) -> int:
    """The time in ns of the longest run of frames (N,) of which something holds."""
    longest, first_ns = 0, None
    for is_so, stamp_ns in zip(holds, stamps_ns.tolist(), strict=True):
        first_ns = (stamp_ns if first_ns is None else first_ns) if is_so else None
        longest = longest if first_ns is None else max(longest, stamp_ns - first_ns)
    return longest


def _stretches(chosen: Sequence[int], closures: Sequence[LoopClosure], walk: Walk) -> tuple[tuple[int, ...], ...]:
    """The constraints that close revisits, by stretches of their later ends."""
    later_ns = {k: max(closures[k].from_ns, closures[k].to_ns) for k in chosen}
    found: list[list[int]] = []
    for k in sorted(chosen, key=lambda k: later_ns[k]):
        last_ns = later_ns[found[-1][-1]] if found else None
        if last_ns is None or not _is_one_stay(last_ns, later_ns[k], walk):
            found.append([])
        found[-1].append(k)
    return tuple(map(tuple, found))


def _is_one_stay(first_ns: int, last_ns: int, walk: Walk) -> bool:
    return last_ns - first_ns <= STRETCH_NS or walk.left_between(first_ns, last_ns) is False
