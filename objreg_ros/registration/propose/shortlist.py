# SPDX-License-Identifier: Apache-2.0
"""From all that the proposers propose to the few hypotheses that are finished.

Hypotheses are drawn to the surface by ever more points, and those of the best view score go on. Yet shape alone may
draw a right one away: where depth errs systematically, two views of a wall or of a table's top fit as well a decimetre
beside the truth. So what was proposed about the best is looked at once more where it was proposed, held there by grey.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.candidate import Score
from objreg_ros.registration.certainty.gravity_update import gravity_error
from objreg_ros.registration.kernels.same_pose import (
    AGREEING,
    BASIN,
    PROPOSED,
    PROPOSED_FROM,
    REFINED,
    SHARED,
    distinct,
    near,
)
from objreg_ros.registration.prepare.prepared import Pair
from objreg_ros.registration.propose.evidence import FINISHED_MARGIN, score_objects
from objreg_ros.registration.propose.fine_search import score_views_sharply
from objreg_ros.registration.propose.hypotheses import (
    Hypothesis,
    from_centroids,
    from_features,
    from_objects,
    from_prior,
)
from objreg_ros.registration.propose.keypoint_poses import from_keypoints
from objreg_ros.registration.propose.object_poses import from_shapes
from objreg_ros.registration.refine.batch_icp import ITERATIONS, REACHES_M, align, settle
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.object_matches import match_objects, score_matched_silhouettes
from objreg_ros.registration.score.view_score import (
    PHOTOMETRIC_POINTS,
    RANKING_POINTS,
    WORST,
    count_both_ways,
    score_counts,
    score_views,
)

REFINED_PER_PROPOSER = 5  # hypotheses that ICP runs to the end
SETTLED = 16  # hypotheses of all proposers, of the best view score, that the whole shape settles
FINISHED = 3  # hypotheses of all proposers that photometric ICP finishes and the gate sees
FIRST_LOOK = (150, 5, 150)  # points, iterations and points of the views a side, for all hypotheses
LOOKED_AT_AGAIN = 12  # hypotheses of each proposer that get more points
BASIN_POINTS = 500  # that bring a hypothesis to its basin
ANCHORED = 2  # hypotheses about each of the best that grey holds where they were proposed
HOPELESS = -0.35  # best total score below which one hypothesis is finished; accepted ones have -0.1 and more
TILTED = 5.5  # deviations of gravity: what is not refined; photometric ICP may bring it to what the gate allows


class Shortlist(NamedTuple):
    """What is to be finished, the ``best`` first, ``hypotheses``: all that may agree with it, and ``of_keypoints``.

    These are what the keypoints proposed, as they did: they may be rivals of it. What grey held where it was proposed
    agrees as it was proposed: it was chosen for being near, and drawn nearer.
    """

    best: tuple[Hypothesis, ...]
    hypotheses: tuple[Hypothesis, ...]
    of_keypoints: tuple[Hypothesis, ...] = ()


def shortlist(pair: Pair, T_target_source_prior: Array | None) -> Shortlist:
    """The hypotheses of all proposers of the best score of views and objects; empty when no proposer proposed any.

    ``T_target_source_prior (4, 4)`` is a pose to start from too, or None.
    """
    shapes, proposed = _upright(pair), _proposed(pair, T_target_source_prior)
    of_keypoints = from_keypoints(pair)  # last: they are found meanwhile
    proposers = [*proposed, of_keypoints]
    drawn = [hypothesis for proposed in proposers for hypothesis in _drawn_best(pair, proposed)]
    hypotheses = _settled(pair, drawn + shapes) + _scored(pair, shapes)
    if not hypotheses:
        return Shortlist((), ())
    best = _best(pair, hypotheses)
    if _total(best[0]) < HOPELESS:
        return Shortlist(tuple(best[:1]), tuple(hypotheses), tuple(of_keypoints))
    about = _about(pair, best, [hypothesis for proposed in proposers for hypothesis in proposed])
    anchored = _anchored(pair, about)
    return Shortlist(tuple(_best(pair, best + anchored)), (*hypotheses, *about), tuple(of_keypoints))


def _proposed(pair: Pair, prior: Array | None) -> list[list[Hypothesis]]:
    """What each proposer but the keypoints proposes."""
    source, target = pair.source, pair.target
    return [
        from_prior(prior),
        from_centroids(source, target),
        from_objects(source, target),
        from_features(source, target),
    ]


def _upright(pair: Pair) -> list[Hypothesis]:
    """The distinct hypotheses of the objects' shapes: they are in their basins already."""
    found = from_shapes(pair.source, pair.target)
    scores = np.array([hypothesis.support for hypothesis in found])
    return [found[k] for k in distinct(_poses(found), scores, pair.source.middle, REFINED_PER_PROPOSER, PROPOSED)]


def _drawn_best(pair: Pair, proposed: list[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses of one proposer, brought to their basins, of the best view score, distinct.

    All are brought near by a few points; what looks hopeless or has become another goes no farther.
    """
    if not proposed:
        return []
    middle = pair.source.middle
    points, iterations, sample = FIRST_LOOK
    T, V = _drawn(pair, _poses(proposed), points, iterations, sample)
    close = distinct(T, V, middle, LOOKED_AT_AGAIN, PROPOSED)
    T, V = _drawn(pair, T[close], BASIN_POINTS, ITERATIONS, RANKING_POINTS)
    chosen = distinct(T, V, middle, REFINED_PER_PROPOSER, BASIN)
    return [replace(proposed[close[k]], T_target_source=T[k]) for k in chosen]


def _drawn(pair: Pair, T: Array, points: int, iterations: int, sample: int) -> tuple[Array, Array]:
    """Poses (K, 4, 4) drawn to the surface by the first so many ``points``, and V of a ``sample`` a side."""
    source, target = pair.source, pair.target
    wide, narrow, _ = REACHES_M
    moved, _, _ = align(source.xyz[:points], source.normals[:points], target.surface, T, wide, narrow, iterations)
    return moved, score_views(source.sight, target.sight, moved, sample)


def _settled(pair: Pair, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses where the shape alone brings them; those that are ahead with their score of views and objects.

    What is in the basin of a better one goes where that goes.
    """
    if not hypotheses:
        return []
    source, target = pair.source, pair.target
    T = _poses(hypotheses)
    V = score_views(source.sight, target.sight, T, RANKING_POINTS)
    ahead = distinct(T, V, source.middle, SETTLED, SHARED)
    poses, firm = settle(source, target, T[ahead])
    settled = [replace(hypotheses[k], T_target_source=pose) for k, pose in zip(ahead, poses, strict=True)]
    good = _hopeful(pair, settled, firm)
    left, behind = np.ones(len(T), bool), []
    left[ahead] = False
    for k, leader in zip(ahead, settled, strict=True):
        follows = np.flatnonzero(left & near(T, T[k], source.middle, SHARED))
        left[follows] = False
        if leader in good:
            behind += [replace(hypotheses[m], T_target_source=leader.T_target_source) for m in follows]
    return _scored(pair, good) + behind


def _hopeful(pair: Pair, hypotheses: list[Hypothesis], firm: Array) -> list[Hypothesis]:
    """The hypotheses that enough points hold and that keep gravity; all of them where none does.

    Two views of nothing in common may look alike by chance: V sees what little meets, and that is not refused.
    """
    good = [
        hypothesis
        for hypothesis, held in zip(hypotheses, firm, strict=True)
        if held and _keeps_gravity(pair, hypothesis)
    ]
    return good or hypotheses


def _keeps_gravity(pair: Pair, hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis, once finished, may keep gravity as the gate wants it."""
    return gravity_error(pair.source, pair.target, hypothesis.T_target_source).sigmas <= TILTED


def _scored(pair: Pair, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses with their score of views and objects; of those that are one pose the best has it."""
    source, target = pair.source, pair.target
    T = _poses(hypotheses)
    forward, backward = count_both_ways(source.sight, target.sight, T, PHOTOMETRIC_POINTS)
    V = score_counts(source.sight, target.sight, forward, backward, PHOTOMETRIC_POINTS)
    apart = distinct(T, V, source.middle, len(hypotheses), REFINED)
    ways = forward[apart], backward[apart]
    sharp = score_views_sharply(source, target, T[apart], ways, PHOTOMETRIC_POINTS)
    scored = [replace(hypothesis, score=None) for hypothesis in hypotheses]
    for k, v in zip(apart, sharp, strict=True):
        hypothesis = hypotheses[k]
        matched, moved = match_objects(source, target, hypothesis.T_target_source)
        same = score_matched_silhouettes(source, target, matched, hypothesis.T_target_source)
        scored[k] = replace(hypothesis, score=Score(float(v), *score_objects(matched, moved, same)))
    return scored


def _best(pair: Pair, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """The distinct hypotheses of the best score that are finished, best first."""
    scores = np.array([_total(hypothesis) for hypothesis in hypotheses])
    best = distinct(_poses(hypotheses), scores, pair.source.middle, FINISHED, AGREEING)
    return [hypotheses[k] for k in best if scores[k] >= scores.max() - FINISHED_MARGIN]


def _total(hypothesis: Hypothesis) -> float:
    """The total score of a hypothesis; the worst where another one of the same pose has it."""
    return WORST if hypothesis.score is None else hypothesis.score.total


def _about(pair: Pair, best: list[Hypothesis], proposed: list[Hypothesis]) -> list[Hypothesis]:
    """What was proposed about the best and looks best as it was proposed; nothing without grey to hold it there."""
    source, target = pair.source, pair.target
    if not proposed or not (source.sight.textured and target.sight.textured):
        return []
    T, V = _poses(proposed), np.full(len(proposed), WORST)
    about = [near(T, found.T_target_source, source.middle, PROPOSED_FROM) for found in best]
    some = np.any(about, axis=0)
    V[some] = score_views(source.sight, target.sight, T[some], RANKING_POINTS)
    chosen: dict[int, Hypothesis] = {}
    for close in map(np.flatnonzero, about):
        chosen |= {k: proposed[k] for k in close[distinct(T[close], V[close], source.middle, ANCHORED, PROPOSED)]}
    return list(chosen.values())


def _anchored(pair: Pair, proposed: list[Hypothesis]) -> list[Hypothesis]:
    """Hypotheses that grey finishes where they were proposed, each with its score; those that keep gravity."""
    source, target = pair.source, pair.target
    finished = (finish(source, target, hypothesis.T_target_source)[0] for hypothesis in proposed)
    anchored = [replace(hypothesis, T_target_source=T) for hypothesis, T in zip(proposed, finished, strict=True)]
    return _scored(pair, [hypothesis for hypothesis in anchored if _keeps_gravity(pair, hypothesis)])


def _poses(hypotheses: list[Hypothesis]) -> Array:
    """The poses (K, 4, 4) of hypotheses."""
    return np.array([hypothesis.T_target_source for hypothesis in hypotheses]).reshape(-1, 4, 4)
