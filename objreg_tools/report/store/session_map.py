# SPDX-License-Identifier: Apache-2.0
"""A session of a store from above: the camera's trajectory, the positions of the objects and their moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.sighting import Sighting
from objreg_tools.report.store.store_summary import StoreSummary


@dataclass(frozen=True, slots=True, eq=False)
class MapPlace:
    """Where a session saw a landmark last, ``xy (2,)`` m, and in how many of its keyframes."""

    landmark: int
    label: str
    xy: Array
    sightings: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionMap:
    """One session in the plane of the two ``axes`` along which it extends most, in m of its own frame.

    ``trajectory (N, 2)`` of the camera; ``moves`` are (label, where it stood (2,), where it stands (2,)).
    """

    session: int
    axes: tuple[str, str]
    trajectory: Array
    places: tuple[MapPlace, ...]
    moves: tuple[tuple[str, Array, Array], ...]

    @property
    def points(self) -> Array:
        """Everything that is drawn, (N, 2)."""
        ends = [end for _, *both in self.moves for end in both]
        return np.array([*self.trajectory, *(place.xy for place in self.places), *ends])


def session_maps(found: StoreSummary) -> list[SessionMap]:
    """All sessions that saw an object, the oldest first."""
    labels = {landmark.landmark: landmark.label for landmark in found.landmarks}
    return [_mapped(found, session, rows, labels) for session, rows in found.by_session.items()]


def _mapped(found: StoreSummary, session: int, rows: Sequence[Sighting], labels: dict[int, str]) -> SessionMap:
    trajectory = np.array([row.camera for row in rows])
    spread = np.ptp(np.concatenate([trajectory, [row.position for row in rows]]), axis=0)
    plane = sorted(np.argsort(spread, kind="stable")[1:].tolist())
    seen: dict[int, list[Sighting]] = {}
    for row in rows:
        seen.setdefault(row.landmark, []).append(row)
    return SessionMap(
        session=session,
        axes=("xyz"[plane[0]], "xyz"[plane[1]]),
        trajectory=trajectory[:, plane],
        places=tuple(MapPlace(n, labels[n], of[-1].position[plane], len(of)) for n, of in sorted(seen.items())),
        moves=tuple(
            (move.here.label, move.nearest.stood[plane], move.nearest.here.position[plane])
            for move in found.moves.known
            if move.nearest.here.session == session
        ),
    )
