# SPDX-License-Identifier: Apache-2.0
"""What is in a store, without its points: counts, labels, sessions, landmarks, and what moved."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.landmarks import Landmark, Landmarks
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.sensor import measured_noise
from objreg_tools.report.store.moved_objects import Move, Moves, moves_in
from objreg_tools.report.store.session_ties import SessionTie, joined, ties_in

MOST_VIEWS = 100  # are read for the noise of their depth


@dataclass(frozen=True, kw_only=True, eq=False)
class StoreSummary:
    """A whole store without its points."""

    path: str
    bytes: int
    counts: dict[str, int]
    landmarks: tuple[Landmark, ...]
    sightings: tuple[Sighting, ...]
    moves: Moves
    ties: tuple[SessionTie, ...]
    vetoed: tuple[LoopClosure, ...]  # that a person withdrew, the oldest veto first
    depth_noise: float | None  # median of the views, in that of a Kinect v1; None where none has enough depth

    @property
    def labels(self) -> dict[str, int]:
        """How many objects there are of each label, most first."""
        return dict(Counter(sighting.label for sighting in self.sightings).most_common())

    @property
    def sessions(self) -> list[dict[str, Any]]:
        """Number, span in time, keyframes and objects of each session."""
        return [
            {
                "session": session,
                "first_ns": min(s.stamp_ns for s in rows),
                "last_ns": max(s.stamp_ns for s in rows),
                "keyframes": len({s.keyframe_id for s in rows}),
                "objects": len(rows),
            }
            for session, rows in self.by_session.items()
        ]

    @cached_property
    def by_landmark(self) -> dict[int, list[Sighting]]:
        """The sightings of each landmark, the oldest first."""
        landmarks: dict[int, list[Sighting]] = {}
        for sighting in self.sightings:
            landmarks.setdefault(sighting.landmark, []).append(sighting)
        return landmarks

    @cached_property
    def by_session(self) -> dict[int, list[Sighting]]:
        """The sightings of each session, the oldest first."""
        sessions: dict[int, list[Sighting]] = {}
        for sighting in sorted(self.sightings, key=lambda s: s.session):
            sessions.setdefault(sighting.session, []).append(sighting)
        return sessions

    def moment(self, sighting: Sighting) -> str:
        """When something was seen: its session, and the time since that began."""
        seconds = 1e-9 * (sighting.stamp_ns - self._began_ns[sighting.session])
        return f"{seconds:.1f} s of session {sighting.session}"

    @cached_property
    def _began_ns(self) -> dict[int, int]:
        return {session: min(s.stamp_ns for s in rows) for session, rows in self.by_session.items()}


def survey(path: str | Path) -> StoreSummary:
    """Look through the store at ``path`` without changing it; StoreError (an OSError) if it is none or damaged."""
    store = Store(path, read_only=True)
    try:
        sightings = tuple(store.sightings())
        landmarks = Landmarks(RegistrarParams(), sightings)
        return StoreSummary(
            path=str(path),
            bytes=Path(path).stat().st_size,
            counts=store.counts(),
            landmarks=landmarks.known(),
            sightings=sightings,
            moves=moves_in(store, sightings),
            ties=ties_in(store, sightings),
            vetoed=tuple(veto.closure for veto in store.vetoes()),
            depth_noise=_depth_noise(store),
        )
    finally:
        store.close()


def _depth_noise(store: Store) -> float | None:
    """The median noise of the depth of stored views; of `MOST_VIEWS` spread evenly where there are more."""
    ids = store.keyframe_ids()
    chosen = np.unique(np.linspace(0, len(ids) - 1, min(len(ids), MOST_VIEWS)).round().astype(int)).tolist()
    noises = (_noise_of(store, ids[k]) for k in chosen)
    known = [noise for noise in noises if noise is not None]
    return float(np.median(known)) if known else None


def _noise_of(store: Store, keyframe_id: int) -> float | None:
    try:
        view = store.keyframe(keyframe_id).view
    except StoreError:
        return None  # a damaged keyframe leaves the others
    return measured_noise(np.nan_to_num(view.xyz[..., 2], nan=0.0))


def describe(found: StoreSummary) -> str:
    """A store in a few lines."""
    lines = [f"{found.path}: a store of objreg_ros, {found.bytes / 1e6:.1f} MB"]
    lines += ["  " + ", ".join(f"{count} {name}" for name, count in found.counts.items())]
    lines += ["  labels: " + (", ".join(f"{name} {count}" for name, count in found.labels.items()) or "none")]
    if found.depth_noise is not None:
        lines.append(f"  depth noise of the views: {found.depth_noise:.2f} (a Kinect v1 has 1)")
    for session in found.sessions:
        seconds = 1e-9 * (session["last_ns"] - session["first_ns"])
        lines.append(
            f"  session {session['session']}: {session['keyframes']} keyframes, {session['objects']} objects "
            f"in {seconds:.1f} s"
        )
    for group in joined(found.ties):
        lines.append(f"  tied together by constraints: sessions {', '.join(map(str, group))}")
    lines += [f"  vetoed: {sentence}" for sentence in vetoes_as_text(found)]
    lines += [f"  moved: {sentence}" for sentence in moves_as_text(found)]
    return "\n".join(lines)


def vetoes_as_text(found: StoreSummary) -> list[str]:
    """The closures that a person withdrew, a line each: id, moments and labels."""
    return [
        f"{closure_id(one)} from {1e-9 * one.from_ns:.3f} s of session {one.from_session} to "
        f"{1e-9 * one.to_ns:.3f} s of session {one.to_session}, {', '.join(one.labels)}"
        for one in found.vetoed
    ]


def moves_as_text(found: StoreSummary) -> list[str]:
    """The moves of objects that closures report, a sentence each; the last counts those that cannot be traced."""
    sentences = [_move_sentence(found, move) for move in found.moves.known]
    if found.moves.untold:
        sentences.append(f"{found.moves.untold} constraints report another, of keyframes that are no longer stored")
    return sentences


def _move_sentence(found: StoreSummary, move: Move) -> str:
    there, here, nearest = move.there, move.here, move.nearest
    stood, stands = (", ".join(f"{value:.2f}" for value in xyz) for xyz in (nearest.stood, nearest.here.position))
    landmarks = f"{there.landmark}" if there.landmark == here.landmark else f"{there.landmark}, now {here.landmark},"
    return (
        f"{here.label} {landmarks} went {nearest.metres:.2f} m between {found.moment(there)} and "
        f"{found.moment(here)}, from ({stood}) to ({stands}) m in session {nearest.here.session}, "
        f"by {move.closures} constraints"
    )
