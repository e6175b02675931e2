# SPDX-License-Identifier: Apache-2.0
"""Where a pose may come from: the proposers and what they propose.

Each is independent of the others but for the middles of objects, from which their shapes are looked for too: where
these two agree the gate counts one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import pose, rotation_between, rotation_from_vector
from objreg_ros.registration.candidate import Score
from objreg_ros.registration.prepare.fpfh import match
from objreg_ros.registration.prepare.prepared import FEATURE_VOXEL_M, Prepared
from objreg_ros.registration.propose.pose_voting import Matches, poses
from objreg_ros.registration.score.view_score import score_views
from objreg_ros.registration.shapes.upright_search import COARSE_POINTS

FEATURE_MATCHES = 600  # most putative matches of features
CENTROID_TOLERANCE_M = 0.12  # how far the centroid of one object may differ between views, which see other sides of it
HYPOTHESES_PER_PROPOSER = 120  # most; more find no more
YAW_STEPS = 36  # of one object upon another without shapes: each 10 deg
UNNAMED_PAIRS = 6  # most objects without a name that are laid upon each other
UNNAMED_SIZES = 0.65  # least ratio of their sizes
MOST_ALIKE = 10  # pairs of objects whose shapes are laid upon each other: those of the most alike size
HYPOTHESES_PER_OBJECT = 60  # most of single objects, whose poses are many


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A pose to be refined, and who proposed it.

    ``support`` is what the proposer ranks it by, in a unit of the proposer's own: votes, view score or total score. It
    is compared with no other proposer's. ``score`` is None until views and objects were asked.
    """

    T_target_source: Array
    proposer: str
    support: float
    score: Score | None = None


def from_features(source: Prepared, target: Prepared) -> list[Hypothesis]:
    """Poses from matched local features of the contexts."""
    a, b, weights = match(source.features, target.features, FEATURE_MATCHES)
    matches = Matches(
        source=source.features.xyz[a].astype(float),
        target=target.features.xyz[b].astype(float),
        source_normals=source.features.normals[a].astype(float),
        target_normals=target.features.normals[b].astype(float),
        weights=weights,
    )
    found = poses(matches, source.up, target.up, 1.5 * FEATURE_VOXEL_M, 0.3, HYPOTHESES_PER_PROPOSER)
    return [Hypothesis(T_target_source=T, proposer="features", support=support) for T, support in found]


def from_centroids(source: Prepared, target: Prepared) -> list[Hypothesis]:
    """Poses from the middles of object pairs and triples; every assignment among look-alikes is tried."""
    pairs = look_alikes(source, target)
    if len(pairs) < 2 or source.up is None or target.up is None:
        return []
    a, b = np.array(pairs).T
    unknown = np.zeros((len(a), 3))
    matches = Matches(
        source=source.centroids[a],
        target=target.centroids[b],
        source_normals=unknown,
        target_normals=unknown,
        weights=np.ones(len(a)),
    )
    found = poses(matches, source.up, target.up, CENTROID_TOLERANCE_M, 0.15, HYPOTHESES_PER_PROPOSER)
    return [Hypothesis(T_target_source=T, proposer="centroids", support=support) for T, support in found]


def from_objects(source: Prepared, target: Prepared) -> list[Hypothesis]:
    """Poses that lay one object upon one of its kind and turn about gravity, every yaw; the best view scores."""
    if source.up is None or target.up is None:
        return []
    i, j = np.array(most_alike(source, target), int).reshape(-1, 2).T
    yaws = np.linspace(0.0, 2.0 * np.pi, YAW_STEPS, endpoint=False)
    R = rotation_from_vector(yaws[:, None] * target.up) @ rotation_between(source.up, target.up)
    moved = np.einsum("kab,ib->ika", R, source.centroids[i])
    T = pose(R, target.centroids[j][:, None] - moved).reshape(-1, 4, 4)
    view_scores = score_views(source.sight, target.sight, T, COARSE_POINTS)
    best = np.argsort(-view_scores, kind="stable")[:HYPOTHESES_PER_OBJECT]
    return [Hypothesis(T_target_source=T[k], proposer="objects", support=float(view_scores[k])) for k in best]


def look_alikes(source: Prepared, target: Prepared) -> list[tuple[int, int]]:
    """Indices of all objects of source and target that a detector may call by one name.

    Of those without a name the `UNNAMED_PAIRS` that are most alike in size, if they are.
    """
    pairs = [(i, j) for i, a in enumerate(source.groups) for j, b in enumerate(target.groups) if a == b]
    unnamed = [(i, j) for i, j in pairs if source.groups[i] == UNNAMED]
    a, b = source.extents, target.extents
    sizes = {(i, j): min(a[i], b[j]) / max(a[i], b[j], 1e-9) for i, j in unnamed}
    alike = sorted((pair for pair in unnamed if sizes[pair] > UNNAMED_SIZES), key=lambda pair: -sizes[pair])
    return [pair for pair in pairs if pair not in sizes or pair in alike[:UNNAMED_PAIRS]]


def most_alike(source: Prepared, target: Prepared) -> list[tuple[int, int]]:
    """At most `MOST_ALIKE` of the look-alikes: every object's best partner first, then those of the most alike size."""
    pairs = look_alikes(source, target)
    if len(pairs) <= MOST_ALIKE:
        return pairs
    unlike = [abs(float(np.log(source.extents[i] / target.extents[j]))) for i, j in pairs]
    best, met = [], (set[int](), set[int]())
    ranked = sorted(range(len(pairs)), key=unlike.__getitem__)
    for k in ranked:
        i, j = pairs[k]
        if i not in met[0] or j not in met[1]:
            best.append(k)
            met[0].add(i)
            met[1].add(j)
    chosen = dict.fromkeys([*best, *ranked])
    return [pairs[k] for k in sorted(list(chosen)[:MOST_ALIKE])]


def from_prior(T_target_source: Array | None) -> list[Hypothesis]:
    """The pose that odometry expects, where it expects one."""
    return (
        []
        if T_target_source is None
        else [Hypothesis(T_target_source=T_target_source, proposer="odometry", support=1.0)]
    )
