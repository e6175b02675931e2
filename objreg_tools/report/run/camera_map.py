# SPDX-License-Identifier: Apache-2.0
"""Where the camera was in one run, by odometry or by the registrar's own tracking, corrected by the closures.

Odometry is one session. Our own tracking is one session until the track is lost, and then another: what lies between is
not known and not invented. Sessions that closures tie together have one frame, that of the longest of them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from objreg_mapper.closure_constraint import ImplausibleError
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse

TRACKED = "tracked"  # the name of our own tracking, where that of a topic of odometry would stand


class TrackedFrame(NamedTuple):
    """A frame with ``T_session_camera (4, 4)``; a session is known by its number."""

    stamp_ns: int
    session: int
    T_session_camera: Array


class MappedFrame(NamedTuple):
    """A frame on the map: its pose in its session; the same where the map has the session's first frame; corrected."""

    stamp_ns: int
    T_session_camera: Array
    T_map_camera_before: Array
    T_map_camera: Array


@dataclass(frozen=True, slots=True, eq=False)
class CameraMap:
    """The largest part of a run that is in one frame: ``frames`` by time, of ``sessions`` many sessions.

    ``graph`` solved it. ``sessions_apart`` and ``frames_apart`` count what no closures tie to it. ``pruned`` closures
    were rejected. ``unsolved`` is why nothing is corrected, empty where it is.
    """

    graph: PoseGraph = field(default_factory=PoseGraph)
    frames: tuple[MappedFrame, ...] = ()
    sessions: int = 0
    sessions_apart: int = 0
    frames_apart: int = 0
    pruned: tuple[LoopClosure, ...] = ()
    unsolved: str = ""

    @classmethod
    def of(
        cls, frames: Sequence[TrackedFrame], closures: Sequence[LoopClosure], params: MapperParams | None = None
    ) -> CameraMap:
        """The map of frames whose stamps increase; ``closures`` name their sessions where there are several."""
        sessions = _by_session(frames)
        best, rest = cls(), set(sessions)
        while sum(len(sessions[name]) for name in rest) > len(best.frames):
            anchor = max(rest, key=lambda name: (len(sessions[name]), -name))
            members = [anchor, *sorted(_reached(anchor, rest, closures) - {anchor})]
            found, placed = _solved({name: sessions[name] for name in members}, closures, params)
            best = max(best, found, key=lambda part: len(part.frames))
            rest -= placed
        left = len(frames) - len(best.frames)
        return replace(best, sessions_apart=len(sessions) - best.sessions, frames_apart=left)

    def keyframes(self) -> int:
        """How many keyframes the graph has on the map."""
        return sum(map(len, self.graph.paths()))


def of_one_clock(closures: Sequence[LoopClosure]) -> list[LoopClosure]:
    """The closures from an earlier to a later stamp: the others tie two runs of the clock; a map is of one."""
    return [closure for closure in closures if closure.from_ns < closure.to_ns]


def _nameless(closures: Sequence[LoopClosure]) -> list[tuple[LoopClosure, LoopClosure]]:
    """Each closure of one robot without its name, as the frames of a run have none, and as it was."""
    alone = [closure for closure in closures if closure.from_robot == closure.to_robot]
    return [(replace(one, from_robot="", to_robot="") if one.from_robot else one, one) for one in alone]


def with_sessions(closures: Sequence[LoopClosure], frames: Sequence[TrackedFrame]) -> tuple[LoopClosure, ...]:
    """The closures with the sessions of their keyframes, by frames whose stamps increase."""
    stamps = [frame.stamp_ns for frame in frames]

    def session_at(stamp_ns: int) -> int | None:
        k = bisect_right(stamps, stamp_ns) - 1
        return frames[k].session if k >= 0 else None

    return tuple(
        replace(closure, from_session=session_at(closure.from_ns), to_session=session_at(closure.to_ns))
        for closure in closures
    )


def _by_session(frames: Sequence[TrackedFrame]) -> dict[int, list[TrackedFrame]]:
    sessions: dict[int, list[TrackedFrame]] = {}
    for frame in frames:
        sessions.setdefault(frame.session, []).append(frame)
    return sessions


def _reached(anchor: int, rest: set[int], closures: Sequence[LoopClosure]) -> set[int]:
    """The sessions of ``rest`` to which closures lead from one of them, whether or not the graph keeps them."""
    pairs = {(closure.from_session, closure.to_session) for closure in closures}
    reached, grown = set[int](), {anchor}
    while grown:
        reached |= grown
        grown = {b for pair in pairs for a, b in (pair, pair[::-1]) if a in reached and b in rest} - reached
    return reached


def _solved(
    sessions: dict[int, list[TrackedFrame]], closures: Sequence[LoopClosure], params: MapperParams | None
) -> tuple[CameraMap, set[int]]:
    """The part of the map that the first of the sessions is in, and the names of the sessions that are there too."""
    known = _nameless(of_one_clock(closures))
    graph, implausible = _graph_of(sessions, [nameless for nameless, _ in known], params)
    named = {id(nameless): closure for nameless, closure in known}
    try:
        pruned, unsolved = graph.optimise().pruned, ""
    except ImportError as error:
        pruned, unsolved = (), str(error)
    placed = {name: number for number, name in enumerate(sessions) if graph.is_in_map(number)}
    mapped = [frame for name, number in placed.items() for frame in _mapped(graph, number, sessions[name])]
    mapped.sort(key=lambda frame: frame.stamp_ns)
    left_out = tuple(named[id(one)] for one in (*pruned, *implausible))
    return CameraMap(graph, tuple(mapped), len(placed), pruned=left_out, unsolved=unsolved), set(placed)


def _graph_of(
    sessions: dict[int, list[TrackedFrame]], closures: Sequence[LoopClosure], params: MapperParams | None
) -> tuple[PoseGraph, tuple[LoopClosure, ...]]:
    """The graph, and the closures that lead farther than the camera went."""
    graph, implausible = PoseGraph(params), []
    for name, frames in sessions.items():
        graph.begin_session(name)
        for frame in frames:
            graph.add_odometry(Odometry(T_odom_body=frame.T_session_camera, stamp_ns=frame.stamp_ns))
    for closure in closures:
        try:
            graph.add_closure(closure)
        except ImplausibleError:
            implausible.append(closure)
    return graph, tuple(implausible)


def _mapped(graph: PoseGraph, number: int, frames: Sequence[TrackedFrame]) -> list[MappedFrame]:
    """The frames of one session. The map's own session is where it was before it was corrected."""
    corrected = graph.corrected([frame.stamp_ns for frame in frames], session=number)
    first = frames[0].T_session_camera
    before = [
        frame.T_session_camera if number == 0 else corrected[0] @ inverse(first) @ frame.T_session_camera
        for frame in frames
    ]
    return [
        MappedFrame(frame.stamp_ns, frame.T_session_camera, T_before, T_after)
        for frame, T_before, T_after in zip(frames, before, corrected, strict=True)
    ]
