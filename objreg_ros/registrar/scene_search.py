# SPDX-License-Identifier: Apache-2.0
"""The registration of objects upon objects of their kind: one alone by its shape, several together as one shape.

What each pair of look-alikes and the middles of all propose is judged by all objects as one, so that a can, whose own
shape tells no yaw, gets it from where the others stand.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import rotation_from_vector, transform
from objreg_ros.registrar.hypotheses import Hypothesis, from_centroids, look_alikes
from objreg_ros.registrar.icp import align
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared
from objreg_ros.registrar.shape import Shape, upright_motion
from objreg_ros.registrar.shape_score import alike
from objreg_ros.registrar.shape_search import Fitting, glance, improve, register_shapes
from objreg_ros.registrar.verify import rank

EACH = 2  # poses that each pair of objects proposes
LESS = 0.1  # likeness that the views' liking makes up for


def from_shapes(source: Prepared, target: Prepared, params: RegistrarParams) -> list[Hypothesis]:
    """Poses that lay objects upon those of their kind, those that objects and views like best first.

    Upright as the objects stand; the best also drawn to all that was seen, or turned a little, where that is liked
    better: far views of a thin thing share nothing of it, and its room still tells the last centimetres and degrees.
    """
    pairs = shape_pairs(source, target)
    alone = len(pairs) == 1
    found = register_shapes(*pairs[0], params) if alone else register_scenes(source, target, params)
    if not found:
        return []
    a, b = pairs[0] if alone else (source.scene, target.scene)
    assert a is not None and b is not None
    T = np.array([fit.T_target_source for fit in found])
    likeness = np.array([fit.score for fit in found])
    worth = _worth(source, target, T, likeness, params)
    best = np.argsort(-worth, kind="stable")[: params.drawn]
    for better in (_drawn(source, target, T[best], a.foot, params), _turned(source, target, T[best], a, b, params)):
        same = np.array([alike(a, b, upright_motion(a, b, each), params) for each in better])
        after = _worth(source, target, better, same, params)
        gain = (after > worth[best]) & (same > likeness[best] - LESS)
        T[best[gain]], worth[best[gain]], likeness[best[gain]] = better[gain], after[gain], same[gain]
    order = np.argsort(-worth, kind="stable")
    return [Hypothesis(T_target_source=T[k], chain="objects", worth=float(worth[k])) for k in order]


def _turned(source: Prepared, target: Prepared, T: Array, a: Shape, b: Shape, params: RegistrarParams) -> Array:
    """Of poses (K, 4, 4) turned a little about where the objects stand those that the views like best: (K, 4, 4).

    What is nearly round tells its yaw to some degrees only; the print of what it stands on tells the rest.
    """
    turns = np.radians(np.outer((-1.0, 1.0), params.drawing_turns).ravel())
    R = np.array([rotation_from_vector(turn * b.R_upright_camera[2]) for turn in turns])
    tried = np.repeat(T[:, None], len(turns), axis=1)
    at = T[:, :3, :3] @ a.foot + T[:, :3, 3]
    tried[..., :3, :3] = R @ T[:, None, :3, :3]
    tried[..., :3, 3] = at[:, None] + (R @ (T[:, None, :3, 3] - at[:, None])[..., None])[..., 0]
    V = rank(source.sight, target.sight, tried.reshape(-1, 4, 4), params, params.quick_sample).reshape(len(T), -1)
    return tried[np.arange(len(T)), V.argmax(axis=1)]


def _worth(source: Prepared, target: Prepared, T: Array, likeness: Array, params: RegistrarParams) -> Array:
    """What poses (K, 4, 4) are worth for the views and for objects that look so much alike under them: (K,)."""
    V = rank(source.sight, target.sight, T, params, params.quick_sample)
    return V + params.likeness_weight * np.clip(likeness, -1.0, 1.0)


def _drawn(source: Prepared, target: Prepared, T: Array, foot: Array, params: RegistrarParams) -> Array:
    """Poses (K, 4, 4) drawn to the whole surface by a few points; as they were where the objects would be left.

    ``foot (3,)`` is where the objects stand, in the source frame.
    """
    _, reach, last = params.reaches
    few, surface = slice(params.drawing_points), target.surface
    drawn, _, _ = align(source.xyz[few], source.normals[few], surface, T, reach, last, params.drawing_rounds)
    gone = np.linalg.norm((drawn - T)[:, :3, :3] @ foot + (drawn - T)[:, :3, 3], axis=1) > params.drawing_reach
    return np.where(gone[:, None, None], T, drawn)


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
