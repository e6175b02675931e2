# SPDX-License-Identifier: Apache-2.0
"""What a pose says of the objects: which lie upon each other under it, and which must have moved."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, transform
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.free_space import SEEN, VIOLATIONS, count
from objreg_ros.registration.shapes.shape import upright_motion
from objreg_ros.registration.shapes.silhouette_score import score_silhouettes
from objreg_ros.sensor import depth_tolerance

MATCHED_DISTANCE_M = 0.06  # two objects match if their centroids are this close
MATCHED_SHARE = 0.28  # of its extent that a centroid may be farther: a large object is never seen whole

Pairs = tuple[ObjectPair, ...]


def match_objects(source: Prepared, target: Prepared, T_target_source: Array) -> tuple[Pairs, Pairs]:
    """(matched, moved): one-to-one pairs of confusable labels, nearest first.

    Matched are those whose middles lie within `MATCHED_DISTANCE_M`, large ones a share of their extent farther;
    moved are those left over of which each, where it stood, is now free space in the other view.
    """
    distances = gaps(source, target, T_target_source)
    spread = MATCHED_SHARE * np.minimum(source.extents[:, None], target.extents[None])
    matched = _assign(source, distances - spread, MATCHED_DISTANCE_M)
    left = distances.copy()
    left[[pair.source for pair in matched], :] = np.inf
    left[:, [pair.target for pair in matched]] = np.inf
    _keep_gone(left, source, target, T_target_source)
    return matched, _assign(source, left, np.inf)


def score_matched_silhouettes(
    source: Prepared, target: Prepared, matched: Pairs, T: Array, reach: float = 0.0
) -> float | None:
    """How alike the matched objects look under a pose, their mean from -1 to 1; None where none has a shape.

    With a ``reach`` in m each stands so far aside along each axis as it looks most alike: what it is, if not where.
    """
    shapes = [(source.shapes[pair.source], target.shapes[pair.target]) for pair in matched]
    scores = [
        score_silhouettes(a, b, upright_motion(a, b, T), reach) for a, b in shapes if a is not None and b is not None
    ]
    return float(np.clip(scores, -1.0, 1.0).mean()) if scores else None


def gaps(source: Prepared, target: Prepared, T_target_source: Array) -> Array:
    """Distances (K, L) m of the objects' middles under a pose; infinite between labels that no detector confuses."""
    moved = transform(T_target_source, source.centroids)
    distances = np.linalg.norm(moved[:, None] - target.centroids[None], axis=-1)
    same = np.array([[a == b for b in target.groups] for a in source.groups], bool).reshape(distances.shape)
    return np.asarray(np.where(same, distances, np.inf))


def _assign(source: Prepared, distances: Array, limit: float) -> Pairs:
    """The nearest pairs, one-to-one, nearer than ``limit``."""
    pairs, used_source, used_target = [], set(), set()
    for flat in np.argsort(distances, axis=None, kind="stable"):
        i, j = np.unravel_index(flat, distances.shape)
        if not distances[i, j] < limit:
            break
        if i not in used_source and j not in used_target:
            used_source.add(i)
            used_target.add(j)
            pairs.append(ObjectPair(int(i), int(j), source.keyframe.objects[i].label))
    return tuple(pairs)


def _keep_gone(distances: Array, source: Prepared, target: Prepared, T: Array) -> None:
    """Make infinite the rows and columns of objects that the other view does not see to be gone."""
    for i in range(distances.shape[0]):
        if np.isfinite(distances[i]).any() and not is_gone(source, i, target, T):
            distances[i, :] = np.inf
    for j in range(distances.shape[1]):
        if np.isfinite(distances[:, j]).any() and not is_gone(target, j, source, inverse(T)):
            distances[:, j] = np.inf


def is_gone(owner: Prepared, index: int, other: Prepared, T_other_owner: Array) -> bool:
    """Whether the other view looks through most of an object where it would stand."""
    points = np.ascontiguousarray(owner.keyframe.objects[index].cloud.xyz[::4])
    sight = other.sight
    counts = count(
        points,
        np.zeros(len(points), np.float32),
        T_other_owner,
        sight.near,
        sight.far,
        sight.detail,
        sight.camera,
        *depth_tolerance(owner.sight.noise, sight.noise),
    )
    return bool(counts[SEEN] >= 0.5 * len(points) and counts[VIOLATIONS] > 0.5 * counts[SEEN])
