# SPDX-License-Identifier: Apache-2.0
"""The objects of a store on a corrected map, as rows and as GeoJSON."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, transform
from objreg_ros.memory.landmark_position import position_of
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LandmarkPlace:
    """A landmark on a map: ``xyz (3,)`` m of its middle and ``covariance (3, 3)`` m^2 as `position_of` has them.

    ``extent`` m is the median diagonal of the box around it. It was seen in so many keyframes of the map
    (``sightings``), for the last time at ``last_seen_ns`` in ``session`` of ``robot``.
    """

    landmark: int
    label: str
    xyz: Array
    covariance: Array
    extent: float
    sightings: int
    last_seen_ns: int
    session: int
    robot: str

    @property
    def sigma(self) -> float:
        """The root of the mean variance along the three axes, m."""
        return float(np.sqrt(np.trace(self.covariance) / 3.0))

    def as_feature(self) -> dict[str, Any]:
        """A GeoJSON feature (RFC 7946), but in metres of the map instead of degrees."""
        return {
            "type": "Feature",
            "id": self.landmark,
            "geometry": {"type": "Point", "coordinates": self.xyz.round(4).tolist()},
            "properties": {
                "label": self.label,
                "covariance": [[float(f"{value:.4g}") for value in row] for row in self.covariance.tolist()],
                "extent": round(self.extent, 3),
                "sightings": self.sightings,
                "last_seen_ns": self.last_seen_ns,
                "session": self.session,
                "robot": self.robot,
            },
        }


def landmark_places(placed: PlacedKeyframes, T_level_map: Array) -> list[LandmarkPlace]:
    """Every landmark that a keyframe of the map shows, in the map turned by ``T_level_map (4, 4)``, the oldest first.

    StoreError where the store cannot be read.
    """
    poses = {
        keyframe.keyframe_id: T_level_map @ T_map_camera @ inverse(keyframe.T_odom_camera)
        for keyframe, T_map_camera in placed
        if keyframe.T_odom_camera is not None
    }
    store = Store(placed.path, read_only=True)
    try:
        sightings = list(store.sightings())
    finally:
        store.close()
    seen: defaultdict[int, list[Sighting]] = defaultdict(list)
    for sighting in sightings:
        if sighting.keyframe_id in poses:
            seen[sighting.landmark].append(sighting)
    labels = {known.landmark: known.label for known in Landmarks(RegistrarParams(), sightings).known()}
    return [_place(labels[number], seen[number], poses) for number in sorted(seen)]


def _place(label: str, seen: Sequence[Sighting], poses: dict[int, Array]) -> LandmarkPlace:
    extents = np.array([sighting.extent for sighting in seen])
    xyz, covariance = position_of(np.array([transform(poses[s.keyframe_id], s.position) for s in seen]), extents)
    last = seen[-1]
    return LandmarkPlace(
        landmark=last.landmark,
        label=label,
        xyz=xyz,
        covariance=covariance,
        extent=float(np.median(extents)),
        sightings=len({sighting.keyframe_id for sighting in seen}),
        last_seen_ns=last.stamp_ns,
        session=last.session,
        robot=last.robot,
    )


def as_geojson(places: Sequence[LandmarkPlace], T_level_map: Array) -> dict[str, Any]:
    """A GeoJSON feature collection in m of the levelled map, and what turned the run's map into that."""
    return {
        "type": "FeatureCollection",
        "frame": "map",
        "unit": "m",
        "T_level_map": T_level_map.round(9).tolist(),
        "features": [place.as_feature() for place in places],
    }
