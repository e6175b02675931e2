# SPDX-License-Identifier: Apache-2.0
"""The keyframes of a store as maps: one of all sessions that closures tie together, as the mapper solves it.

A store has no odometry between its keyframes. It is taken to go from one to the next in two straight lines that are as
long as the path was, so that it is as uncertain. Closures of keyframes that are not stored any more are left out: where
the camera was then is not known. What the mapper does not believe, or leaves open, contradicts the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from objreg_mapper.closure_constraint import ImplausibleError
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import MapSummary, PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import interpolate, inverse, pose_error
from objreg_ros.memory.store import Store
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.truth import LOOSE, Truths, within

STEP_NS = 500_000_000  # at most, between two poses of odometry: the mapper takes a second without one for a gap
LONGEST_NS = 600_000_000_000  # between two keyframes: a longer silence, as of a clock that was set, stays a gap


class Placed(NamedTuple):
    """A keyframe in its session: ``T_session_camera (4, 4)``, ``travelled`` m until then."""

    stamp_ns: int
    T_session_camera: Array
    travelled: float = 0.0


@dataclass(frozen=True)
class Track:
    """The keyframes of one session with a pose, the oldest first."""

    session: int
    robot: str
    keyframes: list[Placed] = field(default_factory=list)


@dataclass(frozen=True)
class Contradiction:
    """A closure that the others contradict: ``why`` in words, and by how much the map differs from it.

    The last are in degrees and cm; None where the map does not have it.
    """

    closure: LoopClosure
    why: str
    rotation_deg: float | None = None
    translation_cm: float | None = None


@dataclass(frozen=True)
class OneMap:
    """Sessions in one frame, that of the first: ``T_map_camera`` of their keyframes, by session and stamp.

    The mapper ``kept`` so many closures; ``lost`` ones are of a keyframe that is not stored any more.
    """

    sessions: tuple[int, ...]
    robots: Mapping[int, str]
    poses: Mapping[tuple[int, int], Array]
    kept: int
    lost: int
    contradictions: tuple[Contradiction, ...]

    def error_cm(self, truths: Truths) -> tuple[float, int] | None:
        """Its error and how many keyframes that is of; None where the truth of fewer than three is known.

        The root mean square of positions after the best rigid motion of the whole map.
        """
        pairs = [
            (T, true)
            for (session, stamp_ns), T in self.poses.items()
            if self.robots[session] in truths.of_robots
            and (true := truths.at(self.robots[session], stamp_ns)) is not None
        ]
        if len(pairs) < 3:
            return None
        return 100.0 * absolute_trajectory_error(*zip(*pairs, strict=True)), len(pairs)


def tracks_of(store: Store) -> list[Track]:
    """The sessions of a store by their numbers. StoreError where it is damaged."""
    heads = {head["id"]: head for head in store.heads()}
    tracks: dict[int, Track] = {}
    for number, T in store.poses():
        head = heads[number]
        track = tracks.setdefault(head["session"], Track(head["session"], head["robot"]))
        last_ns = track.keyframes[-1].stamp_ns if track.keyframes else None
        if T is not None and (last_ns is None or head["stamp_ns"] > last_ns):
            track.keyframes.append(Placed(head["stamp_ns"], T, head["travelled"]))
    return [tracks[session] for session in sorted(tracks) if tracks[session].keyframes]


def one_maps(
    tracks: Sequence[Track], closures: Sequence[LoopClosure], params: MapperParams | None = None
) -> list[OneMap]:
    """A map of each group of sessions that closures tie together, the largest first; a session alone is one too."""
    groups = tied(tracks, closures)
    maps = [_solved([track for track in tracks if track.session in group], closures, params) for group in groups]
    return sorted(maps, key=lambda one: (-len(one.sessions), one.sessions))


def tied(tracks: Sequence[Track], closures: Sequence[LoopClosure]) -> list[Set[int]]:
    """The groups of sessions that closures lead to from each other."""
    group = {track.session: {track.session} for track in tracks}
    for closure in closures:
        one, other = closure.from_session, closure.to_session
        if one in group and other in group and group[one] is not group[other]:
            joined = group[one] | group[other]
            group |= dict.fromkeys(joined, joined)
    return list({id(one): one for one in group.values()}.values())


def _solved(tracks: Sequence[Track], closures: Sequence[LoopClosure], params: MapperParams | None) -> OneMap:
    graph = PoseGraph(params)
    numbers = {track.session: number for number, track in enumerate(tracks)}
    for track in tracks:
        graph.begin_session(track.session)
        for stamp_ns, T in odometry_of(track):
            graph.add_odometry(Odometry(T_odom_body=T, stamp_ns=stamp_ns))
    implausible, given, lost = list[Contradiction](), dict[int, LoopClosure](), 0
    stored = {(track.session, keyframe.stamp_ns) for track in tracks for keyframe in track.keyframes}
    for closure in closures:
        ends = (closure.from_session, closure.from_ns), (closure.to_session, closure.to_ns)
        if closure.from_session not in numbers or closure.to_session not in numbers:
            continue
        if not stored.issuperset(ends):
            lost += 1
        else:
            nameless = replace(closure, from_robot="", to_robot="")  # sessions say more than robots, which have several
            given[id(nameless)] = closure
            try:
                graph.add_closure(nameless)
            except ImplausibleError as error:
                implausible.append(Contradiction(closure, f"cannot be: {error}"))
    summary = graph.optimise()
    placed = [track for track in tracks if graph.is_in_map(numbers[track.session])]
    poses = dict(_poses(graph, numbers, placed))
    return OneMap(
        sessions=tuple(track.session for track in placed),
        robots={track.session: track.robot for track in placed},
        poses=poses,
        kept=len(summary.kept),
        lost=lost,
        contradictions=(*implausible, *_contradictions(summary, given, poses)),
    )


def odometry_of(track: Track) -> Iterator[tuple[int, Array]]:
    """Stamps and poses (4, 4) of a session's keyframes, with as many between them as the mapper needs."""
    yield track.keyframes[0][:2]
    for one, other in pairwise(track.keyframes):
        if other.stamp_ns - one.stamp_ns > LONGEST_NS:
            yield other[:2]
            continue
        out = np.zeros(3) if other.travelled <= one.travelled else _detour(one, other)
        steps = 2 * max(1, -(-(other.stamp_ns - one.stamp_ns) // (2 * STEP_NS)))
        for k in range(1, steps if other.stamp_ns - one.stamp_ns > steps else 1):
            T = np.array(interpolate(one.T_session_camera, other.T_session_camera, k / steps))
            T[:3, 3] += out * (1.0 - abs(2 * k / steps - 1.0))
            yield one.stamp_ns + (other.stamp_ns - one.stamp_ns) * k // steps, T
        yield other[:2]


def _detour(one: Placed, other: Placed) -> Array:
    """How far from the middle of the straight line (3,) m the camera went, for its path to be as long as it was."""
    line, path = other.T_session_camera[:3, 3] - one.T_session_camera[:3, 3], other.travelled - one.travelled
    straight = float(np.linalg.norm(line))
    aside = np.cross(line, np.eye(3)[int(np.argmin(np.abs(line)))]) if straight > 0.0 else np.eye(3)[0]
    return np.asarray(np.sqrt(max(path**2 - straight**2, 0.0)) / 2.0 * aside / np.linalg.norm(aside))


def _poses(
    graph: PoseGraph, numbers: Mapping[int, int], placed: Sequence[Track]
) -> Iterator[tuple[tuple[int, int], Array]]:
    for track in placed:
        stamps = [keyframe.stamp_ns for keyframe in track.keyframes]
        for stamp_ns, T in zip(stamps, graph.corrected(stamps, session=numbers[track.session]), strict=True):
            yield (track.session, stamp_ns), T


def _contradictions(
    summary: MapSummary, given: Mapping[int, LoopClosure], poses: Mapping[tuple[int, int], Array]
) -> Iterator[Contradiction]:
    """What the mapper pruned, and what it kept and yet leaves open by more than a right closure is wrong."""
    for nameless, residual in zip(summary.pruned, summary.residuals, strict=True):
        closure = given[id(nameless)]
        why = f"not believed: {residual:.1f} deviations from what all others say"
        yield Contradiction(closure, why, *(_difference(closure, poses) or (None, None)))
    for nameless in summary.kept:
        closure = given[id(nameless)]
        difference = _difference(closure, poses)
        if difference is not None and not within(difference, LOOSE):
            yield Contradiction(closure, "believed, but its loop does not close", *difference)


def _difference(closure: LoopClosure, poses: Mapping[tuple[int, int], Array]) -> tuple[float, float] | None:
    """Degrees and cm between a closure and the map; None where one of its keyframes is not stored any more."""
    assert closure.from_session is not None and closure.to_session is not None
    T_map_from = poses.get((closure.from_session, closure.from_ns))
    T_map_to = poses.get((closure.to_session, closure.to_ns))
    if T_map_from is None or T_map_to is None:
        return None
    return pose_error(inverse(T_map_from) @ T_map_to, closure.T_from_to)


def within_sessions(closures: Sequence[LoopClosure], sessions: Set[int]) -> list[LoopClosure]:
    """The closures of which both ends are of these sessions."""
    return [one for one in closures if one.from_session in sessions and one.to_session in sessions]
