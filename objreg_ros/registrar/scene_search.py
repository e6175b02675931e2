# SPDX-License-Identifier: Apache-2.0
"""The registration of objects upon objects of their kind: one alone by its shape, several together as one shape.

What each pair of look-alikes and the middles of all propose is judged by all objects as one, so that a can, whose own
shape tells no yaw, gets it from where the others stand.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import transform
from objreg_ros.registrar.hypotheses import Hypothesis, from_centroids, look_alikes
from objreg_ros.registrar.icp import align
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared
from objreg_ros.registrar.shape import Shape, upright_motion, upright_pose
from objreg_ros.registrar.shape_search import Fitting, glance, improve, register_shapes
from objreg_ros.registrar.worth import Worth

EACH = 2  # poses that each pair of objects proposes


def from_shapes(source: Prepared, target: Prepared, params: RegistrarParams) -> list[Hypothesis]:
    """Poses that lay objects upon those of their kind, those that objects and views like best first.

    Upright as the objects stand; the best also drawn to all that was seen, or climbed to what both like best, where
    that is worth more: far views of a thin thing share nothing of it, and its room still tells where it is.
    """
    pairs = shape_pairs(source, target)
    alone = len(pairs) == 1
    found = register_shapes(*pairs[0], params) if alone else register_scenes(source, target, params)
    if not found:
        return []
    a, b = pairs[0] if alone else (source.scene, target.scene)
    assert a is not None and b is not None
    scale = Worth(source, target, a, b, params)
    motions = np.array([upright_motion(a, b, fit.T_target_source) for fit in found])
    worth = scale.of(motions)
    best = np.argsort(-worth, kind="stable")[: params.drawn]
    best = best[worth[best] >= worth[best[0]] - params.shape_margin]
    for better in (partial(_drawn, source, target, a, b, params=params), scale.climbed):
        tried = np.array([better(motion) for motion in motions[best]])
        after = scale.of(tried)
        gain = after > worth[best]
        motions[best[gain]], worth[best[gain]] = tried[gain], after[gain]
    order = np.argsort(-worth, kind="stable")
    poses = [(upright_pose(a, b, motions[k]), float(worth[k])) for k in order]
    return [Hypothesis(T_target_source=T, chain="objects", worth=value) for T, value in poses]


def _drawn(source: Prepared, target: Prepared, a: Shape, b: Shape, motion: Array, params: RegistrarParams) -> Array:
    """An upright motion drawn to the whole surface by a few points; as it was where the objects would be left."""
    _, reach, last = params.reaches
    few, surface, T = slice(params.drawing_points), target.surface, upright_pose(a, b, motion)
    (drawn,), _, _ = align(source.xyz[few], source.normals[few], surface, T[None], reach, last, params.drawing_rounds)
    gone = np.linalg.norm(transform(drawn, a.foot) - transform(T, a.foot)) > params.drawing_reach
    return motion if gone else upright_motion(a, b, drawn)


def register_scenes(source: Prepared, target: Prepared, params: RegistrarParams) -> list[Fitting]:
    """The best distinct poses of all objects of ``source`` upon those of ``target``, best first; empty without any."""
    if source.scene is None or target.scene is None:
        return []
    seeds = [hypothesis.T_target_source for hypothesis in from_centroids(source, target, params)[: params.scene_seeds]]
    pairs = shape_pairs(source, target)
    for a, b in pairs:
        seeds += glance(a, b, EACH, params)
    levelled = [_levelled(pairs, T, params.centroid_tolerance) for T in seeds]
    return improve(source.scene, target.scene, levelled, params) if levelled else []


def shape_pairs(source: Prepared, target: Prepared) -> list[tuple[Shape, Shape]]:
    """The shapes of all objects that a detector may call by one name."""
    pairs = ((source.shapes[i], target.shapes[j]) for i, j in look_alikes(source, target))
    return [(a, b) for a, b in pairs if a is not None and b is not None]


def _levelled(pairs: list[tuple[Shape, Shape]], T_target_source: Array, tolerance: float) -> Array:
    """The pose raised or lowered so that the objects that it brings together stand at the same height.

    What an object stands on is known to a millimetre, its middle to centimetres.
    """
    gaps = np.array([b.foot - transform(T_target_source, a.foot) for a, b in pairs])
    near = np.linalg.norm(gaps, axis=1) < 2.0 * tolerance
    T = T_target_source.copy()
    if near.any():
        up = pairs[0][1].R_upright_camera[2]
        T[:3, 3] += np.median(gaps[near] @ up) * up
    return T
