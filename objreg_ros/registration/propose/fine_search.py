# SPDX-License-Identifier: Apache-2.0
"""A closer look at upright poses of one object upon another, where the first look leaves doubt.

Two sides of an object share next to none of its surface. What it stands on locates it, by grey that is laid from
one view into the other's image (`photometric`): a measure so sharp that it has to be taken near the truth, and several
times as costly as `rank_score`. So it is taken on views at half size, about the poses that were found: farther and
nearer along either line of sight, since the thickness of the object is not known, and turned half, since many a front
looks like its back.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.optimize import minimize

from objreg_ros.data.checked import Array
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.free_space import OCCLUDED, SEEN, VIOLATIONS
from objreg_ros.registration.score.total_score import SILHOUETTE_WEIGHT_UPRIGHT, VIOLATION_WEIGHT_UPRIGHT
from objreg_ros.registration.score.view_score import RANKING_POINTS, WORST, count_both_ways, score_counts, score_sharply
from objreg_ros.registration.shapes.shape import Shape, turned_half, upright_pose
from objreg_ros.registration.shapes.silhouette_score import score_silhouettes
from objreg_ros.registration.shapes.upright_search import SCORE_MARGIN

SEARCHED = 2  # best poses of an object that are searched finely
SIMPLEX_EVALUATIONS = 32  # most of one climb
ALONG = (-0.4, -0.25, -0.12, 0.12, 0.25, 0.4)  # widths along a line of sight at which an object may stand as well
THICK = (0.0, 0.2, 0.4)  # usual thicknesses of an object, in its widths: how far its back may lie behind its front
HOPELESS = -2.0  # score of what no climb brings up
FIRST = np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]])  # rad and m: of a descent
LAST = {"xatol": 0.002, "fatol": 0.004}  # and where it ends


class FineSearch:
    """The fine score of upright motions (yaw, x, y, rise) of shape ``a`` of source upon ``b`` of target.

    Both views must have grey.
    """

    def __init__(self, source: Prepared, target: Prepared, a: Shape, b: Shape) -> None:
        self._views, self._shapes = (source, target), (a, b)
        self._extent = 0.5 * (a.extent + b.extent)

    def of(self, motion: Array) -> float:
        """V as if all that is hidden had been seen to agree, and what the objects say; as `rank_score` weighs them."""
        T, (source, target) = upright_pose(*self._shapes, motion), self._views
        seen = count_both_ways(source.sight, target.sight, T[None], RANKING_POINTS)
        (V,), ways = (
            score_views_sharply(source, target, T[None], seen, RANKING_POINTS),
            [way[0] for way in seen],
        )
        if V == WORST:
            return WORST
        hidden, violations = (max(way[what] / way[SEEN] for way in ways) for what in (OCCLUDED, VIOLATIONS))
        silhouette_score = min(1.0, max(-1.0, score_silhouettes(*self._shapes, motion)))
        return float(V + hidden + SILHOUETTE_WEIGHT_UPRIGHT * silhouette_score - VIOLATION_WEIGHT_UPRIGHT * violations)

    def improved(self, motions: Array) -> tuple[Array, Array]:
        """The first of the motions (N, 4), or what they may be taken for, climbed: the best (K, 4) and their scores.

        None of what is hopeless already.
        """
        tried = np.array([other for motion in motions[:SEARCHED] for other in self._taken_for(motion)])
        scores = np.array([self.of(motion) for motion in tried])
        least = max(HOPELESS, scores.max() - SCORE_MARGIN)
        best = [k for k in np.argsort(-scores, kind="stable")[:SEARCHED] if scores[k] > least]
        climbed = [self._climbed(tried[k]) for k in best]
        return np.array([motion for motion, _ in climbed]).reshape(-1, 4), np.array([scores for _, scores in climbed])

    def _taken_for(self, motion: Array) -> list[Array]:
        """The motion itself, farther and nearer along either line of sight, and turned half."""
        ahead = np.array([1.0, 0.0]), np.array([np.cos(motion[0]), np.sin(motion[0])])
        along = [_moved(motion, 0.0, *(share * self._extent * way)) for share in ALONG for way in ahead]
        return [motion, *along, *turned_half(motion, self._extent * np.array(THICK))]

    def _climbed(self, motion: Array) -> tuple[Array, float]:
        """The motion brought to where its score is highest, and that score.

        By the simplex of Nelder and Mead, "A simplex method for function minimization", 1965.
        """
        most = {"initial_simplex": FIRST, "maxfev": SIMPLEX_EVALUATIONS, **LAST}
        moved = partial(_moved, motion)
        found = minimize(lambda step: -self.of(moved(*step)), FIRST[0], method="Nelder-Mead", options=most)
        return moved(*found.x), -float(found.fun)


def _moved(motion: Array, turn: float, x: float, y: float) -> Array:
    return np.asarray(motion + np.array([turn, x, y, 0.0]))


def score_views_sharply(
    source: Prepared,
    target: Prepared,
    T_target_source: Array,
    ways: tuple[Array, Array],
    sample: int,
) -> Array:
    """V (K,) of poses (K, 4, 4) with the grey of both in one image, at half size; without grey, as `score_counts` has
    it.

    ``ways`` are what `count_both_ways` counted there with the same ``sample``.
    """
    a, b = source.sight, target.sight
    if not (a.textured and b.textured):
        return score_counts(a, b, *ways, sample)
    pictures, each = (source.coarse, target.coarse), zip(T_target_source, *ways, strict=True)
    return np.array([score_sharply(*pictures, T, (there, back), sample) for T, there, back in each])
