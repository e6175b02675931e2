# SPDX-License-Identifier: Apache-2.0
"""What a report shows: the JSON of a run, mapped, beside the truth of its recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.geometry import rigid_fit, transform
from objreg_ros.registration.params import RegistrationParams
from objreg_tools.report.closures.closed_revisits import FIELD_DEG, ClosedRevisits, Walk
from objreg_tools.report.run.camera_map import TRACKED, CameraMap, with_sessions
from objreg_tools.report.run.rows import Glimpse, advancing, closure_of, glimpse_of, read_rows, refusal_of
from objreg_tools.report.run.trajectory_error import absolute_errors, root_mean_square
from objreg_tools.truth import FALSE, Error, Truth, within

PAUSE_NS = 3_600_000_000_000  # what is further from a run is not of it: one stamp of 0 would make it last for decades


@dataclass(frozen=True, slots=True)
class Tracks:
    """The camera's trajectory three times, at ``stamps_ns``: positions (N, 3) m in one frame, the true ones or None.

    ``odometry_error`` and ``corrected_error`` (N,) m are the distances from the truth, None without it.
    ``T_drawn_map`` (4, 4) lays the map over the truth: by it ``corrected`` is drawn.
    """

    stamps_ns: Array
    odometry: Array
    corrected: Array
    true: Array | None
    odometry_error: Array | None = None
    corrected_error: Array | None = None
    T_drawn_map: Array = field(default_factory=lambda: np.eye(4))
    source: str = "odometry"  # or "tracked", by our own tracking

    @property
    def lines(self) -> dict[str, Array]:
        """The trajectories that there are, by name, in the order in which they are drawn."""
        lines = {self.source: self.odometry, "corrected": self.corrected}
        return lines if self.true is None else {"true": self.true, **lines}


@dataclass(frozen=True, eq=False)
class RunSummary:
    """Everything that the sections of a report draw from."""

    name: str
    summary: Mapping[str, Any]
    truth: Truth
    glimpses: tuple[Glimpse, ...] = ()
    closures: tuple[LoopClosure, ...] = ()
    refusals: tuple[Rejected, ...] = ()
    map: CameraMap = field(default_factory=CameraMap)
    pruned: tuple[LoopClosure, ...] = ()

    @classmethod
    def of(cls, name: str, summary: Mapping[str, Any], truth: Truth) -> RunSummary:
        """The summary of a run's JSON; the map is made here. Keys that are missing leave their section out.

        ValueError for what `objreg offline --json` would not write.
        """
        glimpses = read_rows(name, summary, "glimpses", glimpse_of)
        closures = read_rows(name, summary, "constraints", closure_of)
        refusals, by_tracking = read_rows(name, summary, "refusals", refusal_of), summary.get("odometry") == TRACKED
        frames = [frame for _, frame in advancing(glimpses, by_tracking)]
        closures = with_sessions(closures, frames)
        made = CameraMap.of(frames, closures, MapperParams.of_tracking() if by_tracking else None)
        return cls(name, summary, truth, glimpses, closures, refusals, made, made.pruned)

    @property
    def by_tracking(self) -> bool:
        """Whether the trajectory is that of our own tracking, and not of odometry."""
        return bool(self.summary.get("odometry") == TRACKED)

    @property
    def graph(self) -> PoseGraph:
        """What solved the map."""
        return self.map.graph

    @property
    def source(self) -> str:
        """The source of the trajectory, which names its line."""
        return TRACKED if self.by_tracking else "odometry"

    @cached_property
    def stretch_ns(self) -> tuple[int, int]:
        """The first and the last stamp of the most frames that have no pause of `PAUSE_NS` between them.

        Without frames, of all closures. A camera that starts before its clock stamps its first frames with 0.
        """
        stamps_ns = sorted(glimpse.stamp_ns for glimpse in self.glimpses)
        if not stamps_ns:
            ends = [stamp for closure in self.closures for stamp in (closure.from_ns, closure.to_ns)]
            return min(ends, default=0), max(ends, default=0)
        pauses = [k for k in range(1, len(stamps_ns)) if stamps_ns[k] - stamps_ns[k - 1] > PAUSE_NS]
        parts = [stamps_ns[a:b] for a, b in pairwise([0, *pauses, len(stamps_ns)])]
        longest = max(parts, key=len)
        return longest[0], longest[-1]

    @property
    def start_ns(self) -> int:
        """The first stamp of the run."""
        return self.stretch_ns[0]

    def in_time(self, stamp_ns: int) -> bool:
        """Whether a stamp is on the timeline: no more than `PAUSE_NS` from the run."""
        first_ns, last_ns = self.stretch_ns
        return first_ns - PAUSE_NS <= stamp_ns <= last_ns + PAUSE_NS

    @property
    def out_of_time(self) -> dict[str, int]:
        """How many frames, closures and refusals are not on the timeline, without the kinds of which all are."""
        ends = {
            "frames": [glimpse.stamp_ns for glimpse in self.glimpses],
            "closures": [closure.to_ns for closure in self.closures],
            "refusals": [refusal.to_ns for refusal in self.refusals],
        }
        counts = {what: sum(not self.in_time(stamp) for stamp in stamps) for what, stamps in ends.items()}
        return {what: count for what, count in counts.items() if count}

    def seconds(self, stamp_ns: int) -> float:
        """The time since the first stamp."""
        return (stamp_ns - self.start_ns) * 1e-9

    def error(self, closure: LoopClosure) -> Error | None:
        """The true error of a closure (degrees, centimetres); None where truth does not cover it."""
        return self.truth.error(closure)

    def is_false(self, closure: LoopClosure) -> bool:
        """Whether a closure is wrong by truth; False where truth does not cover it."""
        error = self.error(closure)
        return error is not None and not within(error, FALSE)

    @property
    def least_odds(self) -> float:
        """The least odds that the run asked for."""
        params = self.summary.get("about", {}).get("params", {})
        asked = params.get("registrar.least_odds", RegistrationParams().least_odds)
        return float(asked) if isinstance(asked, int | float) else RegistrationParams().least_odds

    @cached_property
    def closed_revisits(self) -> ClosedRevisits:
        """What the constraints close."""
        field_deg = tuple(self.summary.get("field_of_view_deg") or FIELD_DEG)
        return ClosedRevisits.of(self.closures, Walk(self.glimpses, self.by_tracking, field_deg, self.truth))

    @cached_property
    def _glimpse_at(self) -> dict[int, Glimpse]:
        return {glimpse.stamp_ns: glimpse for glimpse in self.glimpses}

    def glimpse_at(self, stamp_ns: int) -> Glimpse | None:
        """The frame of a stamp; None where it is no frame's."""
        return self._glimpse_at.get(stamp_ns)

    @cached_property
    def _labels_at(self) -> dict[int, tuple[str, ...]]:
        return {glimpse.stamp_ns: glimpse.labels for glimpse in self.glimpses}

    def seen_at_both(self, from_ns: int, to_ns: int) -> tuple[str, ...]:
        """The labels that were detected in both frames, by name; none where one stamp is no frame's."""
        first, second = (set(self._labels_at.get(stamp, ())) for stamp in (from_ns, to_ns))
        return tuple(sorted(first & second))

    @property
    def left_out(self) -> int:
        """How many frames with a pose are not on the map because time does not advance at them."""
        posed = sum(glimpse.pose(self.by_tracking) is not None for glimpse in self.glimpses)
        return posed - len(self.map.frames) - self.map.frames_apart

    def poses_before_and_after(self) -> tuple[list[int], list[Array], list[Array]]:
        """The stamps of the frames on the map, and the pose of the camera (4, 4) at each, before and ``T_map_camera``.

        Before it is corrected it is ``T_odom_camera``; of our own tracking, each session where the map has its first
        frame.
        """
        frames = self.map.frames
        stamps = [frame.stamp_ns for frame in frames]
        return stamps, [frame.T_map_camera_before for frame in frames], [frame.T_map_camera for frame in frames]

    @property
    def has_trajectory(self) -> bool:
        """Whether there is a trajectory to draw. One frame of our own tracking is none."""
        return len(self.map.frames) > self.by_tracking

    def tracks(self) -> Tracks | None:
        """Odometry, or our own tracking, corrected and true trajectory, over each other; None without any to draw."""
        stamps, odometry, corrected = self.poses_before_and_after()
        if not self.has_trajectory:
            return None
        true = [self.truth.at(stamp) for stamp in stamps]
        known = [k for k, T in enumerate(true) if T is not None]
        if len(known) < 3:
            line = np.array(stamps), positions(odometry), positions(corrected)
            return Tracks(*line, None, source=self.source)
        stamps = [stamps[k] for k in known]
        odometry, corrected = [odometry[k] for k in known], [corrected[k] for k in known]
        targets = [T for T in true if T is not None]
        return Tracks(
            np.array(stamps),
            _laid_over(odometry, targets),
            _laid_over(corrected, targets),
            positions(targets),
            absolute_errors(odometry, targets),
            absolute_errors(corrected, targets),
            rigid_fit(positions(corrected), positions(targets)),
            self.source,
        )

    def true_trajectory(self) -> tuple[Array, Array] | None:
        """The stamps of the frames that truth covers and the true positions (N, 3) m there; None for fewer than two.

        Without frames, all of the truth.
        """
        stamps = [glimpse.stamp_ns for glimpse in self.glimpses] or self.truth.stamps_ns
        known = [(stamp, T) for stamp in stamps if (T := self.truth.at(stamp)) is not None]
        if len(known) < 2:
            return None
        return np.array([stamp for stamp, _ in known]), positions([T for _, T in known])

    def tracked_trajectory(self) -> tuple[Array, Array] | None:
        """The stamps of the longest session of our own tracking, and ``T_session_camera (N, 4, 4)`` there.

        None for fewer than two frames. Another session begins where the track was lost.
        """
        sessions: dict[int, list[tuple[int, Array]]] = {}
        for glimpse in self.glimpses:
            if glimpse.tracked is not None:
                sessions.setdefault(glimpse.tracked[0], []).append((glimpse.stamp_ns, glimpse.tracked[1]))
        longest = max(sessions.values(), key=len, default=[])
        if len(longest) < 2:
            return None
        return np.array([stamp for stamp, _ in longest]), np.array([T for _, T in longest])

    def objects(self) -> list[tuple[str, Array, Array]]:
        """(label, position before, position in the map) of every object seen on the map."""
        mapped = {frame.stamp_ns: frame for frame in self.map.frames}
        return [
            (label, transform(mapped[at].T_map_camera_before, xyz), transform(mapped[at].T_map_camera, xyz))
            for glimpse, (at, *_) in advancing(self.glimpses, self.by_tracking)
            if at in mapped
            for label, xyz in glimpse.objects
        ]

    def trajectory(self) -> dict[str, Any] | None:
        """The trajectory as JSON: its source, how much is in one piece, its errors; None without a trajectory.

        ``error_cm`` is the root mean square of the absolute trajectory error, before and after closures correct it;
        None without truth.
        """
        of, tracks = self.map, self.tracks()
        if not of.frames:
            return None
        errors = (None, None) if tracks is None else (tracks.odometry_error, tracks.corrected_error)
        rms = [None if error is None else round(100.0 * root_mean_square(error), 3) for error in errors]
        return {
            "of": self.source,
            "frames": len(of.frames),
            "sessions": of.sessions,
            "frames_apart": of.frames_apart,
            "sessions_apart": of.sessions_apart,
            "pruned": len(self.pruned),
            "unsolved": of.unsolved,
            "error_cm": None if None in rms else dict(zip(("before", "after"), rms, strict=True)),
        }


def positions(poses: Sequence[Array]) -> Array:
    """(N, 3) of N poses."""
    return np.array([T[:3, 3] for T in poses]).reshape(-1, 3)


def _laid_over(poses: Sequence[Array], true: Sequence[Array]) -> Array:
    return transform(rigid_fit(positions(poses), positions(true)), positions(poses))
