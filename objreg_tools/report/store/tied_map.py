# SPDX-License-Identifier: Apache-2.0
"""The sessions of a store that closures tie together, in one frame from above, with the ties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_ros.memory.sighting import Sighting
from objreg_tools.report.store.session_map import MapPlace
from objreg_tools.report.store.session_ties import joined
from objreg_tools.report.store.store_summary import StoreSummary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TiedMap:
    """Several sessions in the plane of the two ``axes`` along which they extend most, in m of the oldest one's frame.

    ``trajectories`` are (session, (N, 2)) of the cameras; ``places`` of each landmark where it was seen last; ``ties``
    (earlier session, later session, where the earlier camera was (2,), where the later was (2,)).
    """

    sessions: tuple[int, ...]
    axes: tuple[str, str]
    trajectories: tuple[tuple[int, Array], ...]
    places: tuple[MapPlace, ...]
    ties: tuple[tuple[int, int, Array, Array], ...]

    @property
    def points(self) -> Array:
        """Everything that is drawn, (N, 2)."""
        paths = [path for _, path in self.trajectories]
        return np.concatenate([*paths, np.array([place.xy for place in self.places]).reshape(-1, 2)])


def tied_maps(found: StoreSummary) -> list[TiedMap]:
    """A map of each group of sessions that ties hold together, the oldest first; none where nothing is tied."""
    return [_mapped(found, group) for group in joined(found.ties)]


def _mapped(found: StoreSummary, T_first: dict[int, Array]) -> TiedMap:
    rows = {session: found.by_session[session] for session in T_first}
    paths = {session: transform(T_first[session], np.array([row.camera for row in of])) for session, of in rows.items()}
    last: dict[int, tuple[Sighting, int]] = {}
    for of in rows.values():
        for row in of:
            last[row.landmark] = row, 1 + last.get(row.landmark, (row, 0))[1]
    at = {n: transform(T_first[row.session], row.position) for n, (row, _) in sorted(last.items())}
    spread = np.ptp(np.concatenate([*paths.values(), *(xyz[None] for xyz in at.values())]), axis=0)
    plane = sorted(np.argsort(spread, kind="stable")[1:].tolist())
    labels = {landmark.landmark: landmark.label for landmark in found.landmarks}
    return TiedMap(
        sessions=tuple(T_first),
        axes=("xyz"[plane[0]], "xyz"[plane[1]]),
        trajectories=tuple((session, path[:, plane]) for session, path in paths.items()),
        places=tuple(MapPlace(n, labels[n], xyz[plane], last[n][1]) for n, xyz in at.items()),
        ties=tuple(
            (
                tie.earlier,
                tie.later,
                transform(T_first[tie.earlier], tie.earlier_camera)[plane],
                transform(T_first[tie.later], tie.later_camera)[plane],
            )
            for tie in found.ties
            if tie.earlier in T_first
        ),
    )
