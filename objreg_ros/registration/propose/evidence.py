# SPDX-License-Identifier: Apache-2.0
"""What there is for and against a pose, gathered alike whichever engine found it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from objreg_ros.data.closures import Alignment
from objreg_ros.registration.candidate import Candidate, Score, Verification
from objreg_ros.registration.certainty.covariance import spread_of, worst_translation
from objreg_ros.registration.certainty.degeneracy import systematic_depth_error
from objreg_ros.registration.certainty.gravity_update import gravity_error
from objreg_ros.registration.certainty.observability import DOUBTFUL_SIGMA_M, margin_under_perturbation
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.comparison import SILHOUETTE_WEIGHT
from objreg_ros.registration.score.object_matches import Pairs, match_objects, score_matched_silhouettes
from objreg_ros.registration.score.surroundings import verify_surroundings
from objreg_ros.registration.score.view_score import WORST, certain_violations, verify

OBJECT_BONUS = 0.25  # what a matched object adds to V when candidates are ranked
FINISHED_MARGIN = 0.5  # score below the best at which a hypothesis is not finished
CONSIDERED_MARGIN = 0.1  # V below the best at which a candidate is not considered: the next best is an alias
NEARBY_M = 0.06  # how far along each axis an object may stand where it looks most alike, to decide what it is
MANY_MATCHES = 3  # matched objects that did not all move together, and make up for a plain print


def gather(source: Prepared, target: Prepared, alignment: Alignment, proposers: Iterable[str]) -> Candidate:
    """The candidate of an alignment that ``proposers`` came to, the first of which proposed it; not yet perturbed."""
    T, (proposer, *others) = alignment.T_target_source, proposers
    matched, moved = match_objects(source, target, T)
    gravity = gravity_error(source, target, T)
    return Candidate(
        alignment=alignment,
        proposer=proposer,
        agreeing_proposers=tuple(sorted({proposer, *others})),
        verification=verify(source.sight, target.sight, T),
        matched=matched,
        moved=moved,
        silhouette_score=score_matched_silhouettes(source, target, matched, T),
        silhouettes=score_matched_silhouettes(source, target, matched, T, NEARBY_M),
        yaw_known=any(source.yaw_known[pair.source] and target.yaw_known[pair.target] for pair in matched),
        gravity_error_deg=gravity.degrees,
        gravity_error_sigmas=gravity.sigmas,
        certain_violations=certain_violations(source.sight, target.sight, T),
        systematic_depth_error=systematic_depth_error(source, target, T),
    )


def perturbation_margin_of(candidate: Candidate, source: Prepared, target: Prepared) -> float | None:
    """The score margin of a pose under perturbation to where it would be false; None where it is known well."""
    C = spread_of(candidate.alignment) + candidate.systematic_depth_error
    if worst_translation(C) <= DOUBTFUL_SIGMA_M:
        return None
    return margin_under_perturbation(source, target, candidate.T_target_source, C)


def surroundings_of(candidate: Candidate, source: Prepared, target: Prepared) -> Verification | None:
    """What the views say of a pose without the objects that it matches, where those are few: `verify_surroundings`."""
    pairs, T = candidate.matched, candidate.T_target_source
    if not 0 < len(pairs) < MANY_MATCHES:
        return None
    own_source = np.any([source.own[pair.source] for pair in pairs], axis=0)
    own_target = np.any([target.own[pair.target] for pair in pairs], axis=0)
    return verify_surroundings(source.sight, target.sight, (own_source, own_target), T)


def rank_score(candidate: Candidate) -> Score:
    """What candidates are ranked by: the views' verdict, and the objects' where rooms repeat themselves."""
    objects = score_objects(candidate.matched, candidate.moved, candidate.silhouette_score)
    return Score(candidate.verification.score, *objects)


def score_objects(matched: Pairs, moved: Pairs, silhouette_score: float | None) -> tuple[float, float]:
    """What the objects add to V: by where they stand, and by their silhouettes."""
    stand = OBJECT_BONUS * (min(2, len(matched)) - min(2, len(moved)))
    return stand, SILHOUETTE_WEIGHT * (silhouette_score or 0.0)


def margin_over(candidate: Candidate, competitors: Iterable[Candidate]) -> float:
    """The margin of a candidate's score over the best competing score; over `WORST` where nothing competes.

    Two parts of the score do not separate a right pose from a false one, and are left out:

    Occlusion. V falls with the share of occluded pixels, since false poses occlude many. The true pose occludes as
    many where the two views see a large object from opposite sides. Occluded pixels count here as if they agreed.

    A positive silhouette score. The back of a box may bear the same print as its front, while the views share no side
    of the box under the true pose. A negative score does count against a pose.
    """
    others = (_comparable_score(competitor).total for competitor in competitors if competitor is not candidate)
    return _comparable_score(candidate).total - max(others, default=WORST)


def _comparable_score(candidate: Candidate) -> Score:
    """The score of a pose without occlusion and without a positive silhouette score: see `margin_over`."""
    inconsistent = min(0.0, candidate.silhouette_score or 0.0)
    objects = score_objects(candidate.matched, candidate.moved, inconsistent)
    return Score(unoccluded_score(candidate.verification), *objects)


def unoccluded_score(seen: Verification) -> float:
    """V as it would be if all occluded pixels agreed."""
    return seen.score + seen.occluded
