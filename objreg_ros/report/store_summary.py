# SPDX-License-Identifier: Apache-2.0
"""What is in a store: counts, labels, sessions, landmarks, and a picture of where the objects are."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros.data import Array
from objreg_ros.memory.landmarks import Landmark, Landmarks
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.sensor import measured_noise

PANEL = 640  # px
MARGIN = 60  # px
MOST_VIEWS = 100  # are read for the noise of their depth
COLOURS = np.array([[214, 96, 77], [67, 147, 195], [90, 174, 97], [153, 112, 171], [191, 129, 45], [53, 151, 143]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """The whole of a store without its points."""

    path: str
    bytes: int
    counts: dict[str, int]
    landmarks: tuple[Landmark, ...]
    sightings: tuple[Sighting, ...]
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
            for session, rows in sorted(_by_session(self.sightings).items())
        ]


def survey(path: str | Path) -> Survey:
    """Look through the store at ``path`` without changing it; StoreError (an OSError) if it is none or damaged."""
    store = Store(path, read_only=True)
    try:
        sightings = tuple(store.sightings())
        landmarks = Landmarks(RegistrarParams(), sightings)
        return Survey(
            path=str(path),
            bytes=Path(path).stat().st_size,
            counts=store.counts(),
            landmarks=landmarks.known(),
            sightings=sightings,
            depth_noise=_depth_noise(store),
        )
    finally:
        store.close()


def _depth_noise(store: Store) -> float | None:
    """The median noise of the depth of stored views; of `MOST_VIEWS` spread evenly where there are more."""
    ids = store.keyframe_ids()
    chosen = np.unique(np.linspace(0, len(ids) - 1, min(len(ids), MOST_VIEWS)).round().astype(int)).tolist()
    noises = (_noise_of(store, ids[k]) for k in chosen)
    told = [noise for noise in noises if noise is not None]
    return float(np.median(told)) if told else None


def _noise_of(store: Store, keyframe_id: int) -> float | None:
    try:
        view = store.keyframe(keyframe_id).view
    except StoreError:
        return None  # a damaged keyframe leaves the others to tell
    return measured_noise(np.nan_to_num(view.xyz[..., 2], nan=0.0))


def describe(path: str | Path) -> str:
    """The store at ``path`` in a few lines for a reader. StoreError (an OSError) if it is none or damaged."""
    found = survey(path)
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
    return "\n".join(lines)


def draw(found: Survey) -> Array:
    """A picture (PANEL, width, 3) uint8 RGB: a panel a session, the last four, seen along the axis of least spread.

    Landmarks are dots with label and id, as large as they were seen often; the line is the camera's way.
    """
    sessions = sorted(_by_session(found.sightings).items())[-4:]
    panels = [_panel(number, rows, found.landmarks) for number, rows in sessions]
    return np.hstack(panels) if panels else _sheet("an empty store")


def _panel(number: int, rows: list[Sighting], landmarks: tuple[Landmark, ...]) -> Array:
    sheet = _sheet(f"session {number}")
    known = [landmark for landmark in landmarks if landmark.session == number]
    way = np.array([row.camera for row in rows])
    places = np.array([landmark.position for landmark in known]).reshape(-1, 3)
    flat = _flatten(np.concatenate([way, places]))
    cv2.polylines(sheet, [flat[: len(way), None]], False, (170, 170, 170), 2, cv2.LINE_AA)
    labels = sorted({landmark.label for landmark in known})
    for landmark, (x, y) in zip(known, flat[len(way) :].tolist(), strict=True):
        colour = COLOURS[labels.index(landmark.label) % len(COLOURS)].tolist()
        cv2.circle(sheet, (x, y), 4 + min(landmark.sightings, 8), colour, -1, cv2.LINE_AA)
        _write(sheet, f"{landmark.label} {landmark.landmark}", (x + 10, y - 6))
    return sheet


def _flatten(points: Array) -> Array:
    """Points (N, 3) m to pixels (N, 2) of a panel, without the axis along which they spread least."""
    axes = np.sort(np.argsort(np.ptp(points, axis=0), kind="stable")[1:])
    plane = points[:, axes]
    scale = (PANEL - 2 * MARGIN) / max(float(np.ptp(plane, axis=0).max()), 1e-3)
    pixels = (plane - plane.min(axis=0)) * scale + MARGIN
    return np.asarray(np.rint(np.stack([pixels[:, 0], PANEL - pixels[:, 1]], axis=1)), np.int32)


def _sheet(title: str) -> Array:
    sheet = np.full((PANEL, PANEL, 3), 255, np.uint8)
    _write(sheet, title, (12, 24))
    return sheet


def _write(sheet: Array, text: str, at: tuple[int, int]) -> None:
    cv2.putText(sheet, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (60, 60, 60), 1, cv2.LINE_AA)


def _by_session(sightings: tuple[Sighting, ...]) -> dict[int, list[Sighting]]:
    sessions: dict[int, list[Sighting]] = {}
    for sighting in sightings:
        sessions.setdefault(sighting.session, []).append(sighting)
    return sessions
