# SPDX-License-Identifier: Apache-2.0
"""How wrong a constraint truly is, by the ground truth of its recording.

The truth is the pose of the colour camera's optical frame in the world over time. The error of a closure is that of
``T_from_to`` against ``inverse(T_world_from) @ T_world_to``: degrees and centimetres.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.data.frames import JUMP_NS
from objreg_ros.geometry import interpolate, inverse, pose_error
from objreg_tools.recording.poses import passed_over, pose_of
from objreg_tools.recording.record import Recording

STRICT = (3.0, 5.0)  # degrees, centimetres
LOOSE = (5.0, 10.0)
FALSE = (8.0, 15.0)  # worse than this in either is a false constraint
MAX_GAP_NS = 200_000_000  # the truth is not interpolated over more than this

Error = tuple[float, float]


class Truth:
    """The true path of the camera. Stamps must increase: later poses of an earlier time are left out.

    So is one whose stamp leaps ahead alone, for it would leave out all that follow. ``notes`` say what is odd about it,
    for the user.
    """

    def __init__(self, poses: Iterable[tuple[int, Array]], notes: Sequence[str] = ()) -> None:
        given = list(poses)
        kept = _in_order([stamp_ns for stamp_ns, _ in given])
        self.stamps_ns: list[int] = [given[i][0] for i in kept]
        self.poses: list[Array] = [given[i][1] for i in kept]
        self.notes = (*notes, *_out_of_order(len(given) - len(kept), len(given)))

    @classmethod
    def of(cls, recording: Recording, topic: str | None) -> Truth:
        """The truth on a topic of a recording; without poses if ``topic`` is None. What is no pose is passed over."""
        given = [pose_of(record) for record in (recording.records([topic]) if topic else ())]
        poses = [odometry for odometry in given if odometry is not None]
        notes = passed_over(len(given) - len(poses), len(given), f"the ground truth {topic}")
        return cls(((odometry.stamp_ns, odometry.T_odom_body) for odometry in poses), notes)

    @property
    def length(self) -> float:
        """How far the camera went, in metres."""
        positions = np.array([T[:3, 3] for T in self.poses]).reshape(-1, 3)
        return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())

    def at(self, stamp_ns: int) -> Array | None:
        """``T_world_camera`` at a time; None before the first, after the last and within a gap."""
        after = bisect_left(self.stamps_ns, stamp_ns)
        if after < len(self.stamps_ns) and self.stamps_ns[after] == stamp_ns:
            return self.poses[after]
        if not 0 < after < len(self.stamps_ns):
            return None
        start, end = self.stamps_ns[after - 1], self.stamps_ns[after]
        if end - start > MAX_GAP_NS:
            return None
        return interpolate(self.poses[after - 1], self.poses[after], (stamp_ns - start) / (end - start))

    def between(self, from_ns: int, to_ns: int) -> Array | None:
        """The true ``T_from_to`` between two times; None where the truth is not known."""
        T_world_from, T_world_to = self.at(from_ns), self.at(to_ns)
        return None if T_world_from is None or T_world_to is None else inverse(T_world_from) @ T_world_to

    def error(self, closure: LoopClosure | Rejected) -> Error | None:
        """(degrees, centimetres) between a pose and the truth; None where there is no pose, or no truth for it."""
        T_from_to = self.between(closure.from_ns, closure.to_ns)
        return None if T_from_to is None or closure.T_from_to is None else pose_error(closure.T_from_to, T_from_to)

    def errors(self, closures: Iterable[LoopClosure]) -> list[Error]:
        """The error of every closure whose truth is known."""
        return [error for closure in closures if (error := self.error(closure)) is not None]


class Truths:
    """The true paths of several robots by name, all in one world: how wrong a constraint between two of them is.

    A robot of which nothing is known has a `Truth` without poses. ValueError for a robot that is not among them.
    """

    def __init__(self, of_robots: Mapping[str, Truth]) -> None:
        self.of_robots = dict(of_robots)

    def at(self, robot: str, stamp_ns: int) -> Array | None:
        """``T_world_camera`` of a robot at a time; None where its truth is not known."""
        if robot not in self.of_robots:
            raise ValueError(
                f"robot: expected one of {', '.join(self.of_robots)}, got {robot!r}; name it in the closure"
            )
        return self.of_robots[robot].at(stamp_ns)

    def error(self, closure: LoopClosure | Rejected) -> Error | None:
        """(degrees, centimetres) between a pose and the truth; None where there is no pose, or no truth for it."""
        T_world_from = self.at(closure.from_robot, closure.from_ns)
        T_world_to = self.at(closure.to_robot, closure.to_ns)
        if T_world_from is None or T_world_to is None or closure.T_from_to is None:
            return None
        return pose_error(closure.T_from_to, inverse(T_world_from) @ T_world_to)

    def errors(self, closures: Iterable[LoopClosure]) -> list[Error]:
        """The error of every closure whose truth is known."""
        return [error for closure in closures if (error := self.error(closure)) is not None]


def _in_order(stamps_ns: Sequence[int]) -> list[int]:
    """The indices of increasing stamps, without one that is `JUMP_NS` ahead of the two behind it and parts them."""
    kept: list[int] = []
    for i, stamp_ns in enumerate(stamps_ns):
        behind, last_ns = stamps_ns[i + 1 : i + 3], stamps_ns[kept[-1]] if kept else None
        is_alone = bool(behind) and stamp_ns - max(behind) >= JUMP_NS and (last_ns is None or behind[0] > last_ns)
        if not is_alone and (last_ns is None or stamp_ns > last_ns):
            kept.append(i)
    return kept


def _out_of_order(count: int, of: int) -> list[str]:
    note = f"{count} of {of} poses of the ground truth are left out: their stamps do not increase, or leap ahead alone"
    return [note] if count else []


def within(error: Error, bound: Error) -> bool:
    """Whether both parts of an error are within a bound."""
    return error[0] <= bound[0] and error[1] <= bound[1]


def summarise(errors: Sequence[Error]) -> dict[str, Any]:
    """The errors of closures as the JSON of an offline run shows them; the spreads are None without any."""
    rotation, translation = (spread([error[i] for error in errors]) for i in (0, 1))
    return {
        "rotation_deg": rotation,
        "translation_cm": translation,
        "strict": sum(within(error, STRICT) for error in errors),
        "loose": sum(within(error, LOOSE) for error in errors),
        "false": sum(not within(error, FALSE) for error in errors),
        "count": len(errors),
    }


def spread(values: Sequence[float]) -> dict[str, float | None]:
    """Median, 95th percentile and maximum; None without values."""
    if not values:
        return {"median": None, "p95": None, "max": None}
    median, p95, largest = (float(v) for v in np.percentile(values, (50, 95, 100)))
    return {"median": median, "p95": p95, "max": largest}
