# SPDX-License-Identifier: Apache-2.0
"""The landmarks of a run with their points on its corrected map, each object once.

Landmarks that the registrar kept apart are one here where the corrected map puts their points upon each other: drift is
gone, so the place decides. Two that one keyframe shows together stay two.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, ObjectCloud, PointFlag
from objreg_ros.geometry import rotate, transform
from objreg_ros.memory.store import Store, StoreError

LEAST_POINTS = 30  # of a view that is used
SAME_M = 0.03  # points of one surface are this near on the corrected map
SAME_SHARE = 0.5  # of the points of the smaller one of two that are one object
COMPARED = 300  # points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectView:
    """What one keyframe at ``stamp_ns`` saw of an object, on the map.

    ``xyz (M, 3)`` m with ``normals (M, 3)`` towards that camera (0 0 0: unknown), ``spacing`` m between neighbours.
    """

    stamp_ns: int
    xyz: Array
    normals: Array
    spacing: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MappedObject:
    """An object of the map: the id of its ``landmark``, the ids that turned out to be it, and its views by time."""

    landmark: int
    label: str
    views: tuple[ObjectView, ...]
    joined: tuple[int, ...] = ()

    @property
    def ids(self) -> tuple[int, ...]:
        """Every id by which it is known."""
        return self.landmark, *self.joined

    def near(self, stamp_ns: int, most: int) -> tuple[ObjectView, ...]:
        """The views that are nearest in time, at most so many: the map is surest between those."""
        return tuple(sorted(self.views, key=lambda view: abs(view.stamp_ns - stamp_ns))[:most])


def mapped_objects(store: Store, T_map_camera: Mapping[int, Array]) -> tuple[MappedObject, ...]:
    """The objects of a store by id, in the keyframes whose stamps ``T_map_camera`` has; damaged ones are left out."""
    views: dict[int, list[ObjectView]] = {}
    votes: dict[int, dict[str, float]] = {}
    for keyframe_id in store.keyframe_ids():
        try:
            keyframe, sightings = store.keyframe(keyframe_id), tuple(store.sightings(keyframe_id))
        except StoreError:
            continue
        T = T_map_camera.get(keyframe.stamp_ns)
        for item, sighting in zip(keyframe.objects, sightings, strict=True):
            view = None if T is None else _view(item.cloud, keyframe.stamp_ns, T)
            if view is not None:
                views.setdefault(sighting.landmark, []).append(view)
                of = votes.setdefault(sighting.landmark, {})
                of[sighting.label] = of.get(sighting.label, 0.0) + sighting.score
    found = [
        MappedObject(
            landmark=number, label=_elected(votes[number]), views=tuple(sorted(of, key=lambda view: view.stamp_ns))
        )
        for number, of in sorted(views.items())
    ]
    return joined(found)


def joined(objects: Sequence[MappedObject]) -> tuple[MappedObject, ...]:
    """The objects, those made one whose points lie upon each other; the oldest id stays, and a name beats none."""
    kept = {one.landmark: one for one in objects}
    trees = {one.landmark: cKDTree(_points(one)) for one in objects}
    for older, newer in combinations(sorted(kept), 2):
        if older not in kept or newer not in kept:
            continue
        a, b = kept[older], kept[newer]
        if _may_be_one(a, b) and _overlap(trees[older], trees[newer]) >= SAME_SHARE:
            kept[older] = _as_one(a, b)
            trees[older] = cKDTree(_points(kept[older]))
            del kept[newer]
    return tuple(kept.values())


def _view(cloud: ObjectCloud, stamp_ns: int, T_map_camera: Array) -> ObjectView | None:
    """None for what is no object of its own, or too small."""
    good = (cloud.flags & PointFlag.EDGE) == 0
    if cloud.has(PointFlag.WALL_LIKE) or good.sum() < LEAST_POINTS:
        return None
    return ObjectView(
        stamp_ns=stamp_ns,
        xyz=transform(T_map_camera, cloud.xyz[good].astype(float)),
        normals=rotate(T_map_camera, cloud.normals[good].astype(float)),
        spacing=1.0 / max(float(cloud.density), 1.0) ** 0.5,
    )


def _elected(votes: Mapping[str, float]) -> str:
    """The label with the most votes; a name, where there is one."""
    named = {label: weight for label, weight in votes.items() if label != UNNAMED} or votes
    return max(named, key=lambda label: (named[label], label))


def _points(one: MappedObject) -> Array:
    xyz = np.concatenate([view.xyz for view in one.views])
    return xyz[:: max(1, len(xyz) // (COMPARED * len(one.views)))]


def _may_be_one(a: MappedObject, b: MappedObject) -> bool:
    stamps = {view.stamp_ns for view in a.views}
    beside = any(view.stamp_ns in stamps for view in b.views)
    return not beside and (a.label == b.label or UNNAMED in (a.label, b.label))


def _overlap(a: cKDTree, b: cKDTree) -> float:
    """The share of the points of one that lie upon the other, of the one of which more do."""
    if np.any(a.mins - SAME_M > b.maxes) or np.any(b.mins - SAME_M > a.maxes):
        return 0.0
    return max(
        float(np.isfinite(other.query(one.data, distance_upper_bound=SAME_M)[0]).mean())
        for one, other in ((a, b), (b, a))
    )


def _as_one(a: MappedObject, b: MappedObject) -> MappedObject:
    views = tuple(sorted((*a.views, *b.views), key=lambda view: view.stamp_ns))
    label = b.label if a.label == UNNAMED else a.label
    return replace(a, label=label, views=views, joined=(*a.joined, *b.ids))


def ids_of(objects: Iterable[MappedObject]) -> dict[int, MappedObject]:
    """The object of every id."""
    return {number: one for one in objects for number in one.ids}
