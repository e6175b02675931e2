# SPDX-License-Identifier: Apache-2.0
"""The registration of objects upon objects of their kind: one alone by its shape, several together as one shape.

What each pair of look-alikes and the middles of all propose is judged by all objects as one, so that a can, whose own
shape fixes no yaw, gets it from where the others stand.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.propose.fine_search import FineSearch
from objreg_ros.registration.propose.hypotheses import CENTROID_TOLERANCE_M, Hypothesis, from_centroids, most_alike
from objreg_ros.registration.refine.batch_icp import REACHES_M, align
from objreg_ros.registration.score.total_score import TotalScore
from objreg_ros.registration.shapes.shape import Shape, turned_half, upright_motion, upright_pose
from objreg_ros.registration.shapes.upright_search import (
    DEPTH_SHARE,
    SCORE_MARGIN,
    ScoredPose,
    coarse_poses,
    improve,
    register_shapes,
)

CENTROID_POSES = 8  # that the centroids propose for all objects together
ALIGNED = 2  # best upright poses that are aligned to everything seen
ALIGNED_POINTS = 300  # by which they are
ALIGNED_ITERATIONS = 10  # most
ALIGNED_REACH_M = 0.06  # a pose stays as it was if aligning moves the objects farther
FINE_SEARCH_BELOW = 1.0  # total score of a lone object's best pose below which it gets a fine search
EACH = 2  # poses that each pair of objects proposes
THICK = (0.0, 0.5, 1.0)  # of the usual depth of an object of its size: how far its back may lie behind its front


def from_shapes(source: Prepared, target: Prepared) -> list[Hypothesis]:
    """Poses that lay objects upon those of their kind, those of the best total score first.

    Upright as the objects stand; the best also drawn to all that was seen, or climbed to the best total score, where
    that is higher: far views of a thin object share nothing of it, and its surroundings locate it. A lone object
    whose best pose scores low even so gets a fine search.
    """
    pairs = shape_pairs(source, target)
    alone = len(pairs) == 1
    found = register_shapes(*pairs[0]) if alone else register_scenes(source, target)
    if not found:
        return []
    a, b = pairs[0] if alone else (source.scene, target.scene)
    assert a is not None and b is not None
    objective = TotalScore(source, target, a, b)
    motions = upright_motion(a, b, np.array([fit.T_target_source for fit in found]))
    total_scores = objective.of(motions)
    best = np.argsort(-total_scores, kind="stable")[:ALIGNED]
    best = best[total_scores[best] >= total_scores[best[0]] - SCORE_MARGIN]
    motions[best], total_scores[best] = _improved(source, target, a, b, motions[best], objective)
    order = np.argsort(-total_scores, kind="stable")
    if alone and total_scores[order[0]] < FINE_SEARCH_BELOW and source.sight.textured and target.sight.textured:
        closer = FineSearch(source, target, a, b).improved(motions[order])
        motions, total_scores = np.concatenate([closer[0], motions]), np.concatenate([closer[1], total_scores])
        order = np.argsort(-total_scores, kind="stable")
    best_first = zip(upright_pose(a, b, motions[order]), total_scores[order].tolist(), strict=True)
    return [Hypothesis(T_target_source=T, proposer="objects", support=value) for T, value in best_first]


def half_turned(source: Prepared, target: Prepared, pair: ObjectPair, T_target_source: Array) -> Array | None:
    """The pose (4, 4) with a ``pair`` of objects turned half about their middle, where its total score is best.

    Front and back of a screen look alike, and the true pose, in which they share nothing, scores lower than the one
    that lays them upon each other. A caller that has to separate them needs both. None where an object has no shape.
    """
    a, b = source.shapes[pair.source], target.shapes[pair.target]
    if a is None or b is None:
        return None
    through = DEPTH_SHARE * (a.extent + b.extent) * np.array(THICK)
    turned = turned_half(upright_motion(a, b, T_target_source), through)
    motions, total_scores = _improved(source, target, a, b, turned, TotalScore(source, target, a, b))
    return upright_pose(a, b, motions[np.argmax(total_scores)])


def _improved(
    source: Prepared,
    target: Prepared,
    a: Shape,
    b: Shape,
    motions: Array,
    objective: TotalScore,
) -> tuple[Array, Array]:
    """Upright motions (K, 4) drawn to all that was seen, then climbed, where each scores higher; their total scores."""
    best, total_scores = motions.copy(), objective.of(motions)
    for better in (partial(_drawn, source, target, a, b), objective.climbed):
        tried = np.array([better(motion) for motion in best])
        after = objective.of(tried)
        higher = after > total_scores
        best[higher], total_scores[higher] = tried[higher], after[higher]
    return best, total_scores


def _drawn(source: Prepared, target: Prepared, a: Shape, b: Shape, motion: Array) -> Array:
    """An upright motion drawn to the whole surface by a few points; as it was where the objects would be left."""
    _, reach, last = REACHES_M
    few, surface, T = slice(ALIGNED_POINTS), target.surface, upright_pose(a, b, motion)
    (drawn,), _, _ = align(source.xyz[few], source.normals[few], surface, T[None], reach, last, ALIGNED_ITERATIONS)
    gone = np.linalg.norm(transform(drawn, a.foot) - transform(T, a.foot)) > ALIGNED_REACH_M
    return motion if gone else upright_motion(a, b, drawn)


def register_scenes(source: Prepared, target: Prepared) -> list[ScoredPose]:
    """The best distinct poses of all objects of ``source`` upon those of ``target``, best first; empty without any."""
    if source.scene is None or target.scene is None:
        return []
    pairs = shape_pairs(source, target)
    if not pairs:
        return []
    starts = [hypothesis.T_target_source for hypothesis in from_centroids(source, target)[:CENTROID_POSES]]
    for a, b in pairs:
        starts += coarse_poses(a, b, EACH)
    feet_a, feet_b = (np.array([shape.foot for shape in shapes]) for shapes in zip(*pairs, strict=True))
    up = pairs[0][1].R_upright_camera[2]
    at_one_height = _at_one_height(feet_a, feet_b, up, np.array(starts), CENTROID_TOLERANCE_M)
    return improve(source.scene, target.scene, at_one_height)


def shape_pairs(source: Prepared, target: Prepared) -> list[tuple[Shape, Shape]]:
    """The shapes of the most alike objects that a detector may call by one name."""
    pairs = ((source.shapes[i], target.shapes[j]) for i, j in most_alike(source, target))
    return [(a, b) for a, b in pairs if a is not None and b is not None]


def _at_one_height(
    feet_source: Array, feet_target: Array, up: Array, T_target_source: Array, tolerance: float
) -> Array:
    """The poses (K, 4, 4) raised or lowered so that the objects that each brings together stand at the same height.

    What an object stands on is known to a millimetre, its middle to centimetres. Feet (P, 3) of P pairs that may be
    one object, ``up (3,)`` in the target's frame.
    """
    R, t = T_target_source[:, :3, :3], T_target_source[:, None, :3, 3]
    gaps = feet_target - (feet_source @ R.transpose(0, 2, 1) + t)
    near = np.linalg.norm(gaps, axis=2) < 2.0 * tolerance
    rises = np.sort(np.where(near, gaps @ up, np.inf), axis=1)
    T, some, count = T_target_source.copy(), near.any(axis=1), near.sum(axis=1)
    rises, count = rises[some], count[some]
    rows = np.arange(len(rises))
    T[some, :3, 3] += 0.5 * (rises[rows, (count - 1) // 2] + rises[rows, count // 2])[:, None] * up
    return T
