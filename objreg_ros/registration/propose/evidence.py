# SPDX-License-Identifier: Apache-2.0
"""What there is for and against a pose, gathered alike whichever engine found it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from objreg_ros.data import Alignment, Array
from objreg_ros.registration.candidate import Candidate, Verification
from objreg_ros.registration.certainty.covariance import spread_of, worst_translation
from objreg_ros.registration.certainty.degeneracy import warp
from objreg_ros.registration.certainty.observability import resistance
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.object_matches import Pairs, explain, likeness
from objreg_ros.registration.score.surroundings import verify_surroundings
from objreg_ros.registration.score.view_score import WORST, floating, verify


def gather(
    source: Prepared, target: Prepared, alignment: Alignment, chains: Iterable[str], params: RegistrarParams
) -> Candidate:
    """The candidate of an alignment that ``chains`` came to, the first of which proposed it; not yet pushed."""
    T, (chain, *others) = alignment.T_target_source, chains
    explained, moved = explain(source, target, T, params)
    return Candidate(
        alignment=alignment,
        chain=chain,
        agreeing_chains=tuple(sorted({chain, *others})),
        verification=verify(source.sight, target.sight, T, params),
        explained=explained,
        moved=moved,
        likeness=likeness(source, target, explained, T, params),
        likeness_nearby=likeness(source, target, explained, T, params, params.likeness_reach),
        yaw_known=any(source.yaw_known[pair.source] and target.yaw_known[pair.target] for pair in explained),
        gravity_error_deg=gravity_error_deg(source, target, T),
        floating=floating(source.sight, target.sight, T, params),
        warp=warp(source, target, T, params),
    )


def resistance_of(candidate: Candidate, source: Prepared, target: Prepared, params: RegistrarParams) -> float | None:
    """How the views resist a push to where the pose would be false; None where it is known well."""
    C = spread_of(candidate.alignment, params) + candidate.warp
    if worst_translation(C) <= params.doubtful_sigma:
        return None
    return resistance(source, target, candidate.T_target_source, C, params)


def surroundings_of(
    candidate: Candidate, source: Prepared, target: Prepared, params: RegistrarParams
) -> Verification | None:
    """What the views say of a pose without the objects that it explains, where those are few: `verify_surroundings`."""
    pairs, T = candidate.explained, candidate.T_target_source
    if not 0 < len(pairs) < params.min_objects_plain:
        return None
    own_source = np.any([source.own[pair.source] for pair in pairs], axis=0)
    own_target = np.any([target.own[pair.target] for pair in pairs], axis=0)
    return verify_surroundings(source.sight, target.sight, (own_source, own_target), T, params)


def gravity_error_deg(source: Prepared, target: Prepared, T_target_source: Array) -> float | None:
    """The angle between the two gravities under a pose; None where one is unknown."""
    if source.up is None or target.up is None:
        return None
    return float(np.degrees(np.arccos(np.clip(T_target_source[:3, :3] @ source.up @ target.up, -1.0, 1.0))))


def worth(candidate: Candidate, params: RegistrarParams) -> float:
    """What candidates are ranked by: the views' verdict, and the objects' where rooms repeat themselves."""
    more = agreement(candidate.explained, candidate.moved, candidate.likeness, params)
    return candidate.verification.score + more


def agreement(explained: Pairs, moved: Pairs, likeness: float | None, params: RegistrarParams) -> float:
    """What the objects add to V."""
    stand = params.object_bonus * (min(2, len(explained)) - min(2, len(moved)))
    return stand + params.likeness_weight * (likeness or 0.0)


def lead(candidate: Candidate, rivals: Iterable[Candidate], params: RegistrarParams) -> float:
    """How much more a candidate is worth than the best of its rivals; than the lowest score where it has none.

    What is hidden says nothing of which of two poses is the right one. V counts it against a pose all the same, as
    wrong ones hide much; but so does the true one where the views see a large thing from either side. Nor does it say
    anything that an object looks alike: the back of a box may have the print of its front, and the views share no side
    of it under the true pose. That it looks otherwise does.
    """
    others = (_told(rival, params) for rival in rivals if rival is not candidate)
    return _told(candidate, params) - max(others, default=WORST)


def _told(candidate: Candidate, params: RegistrarParams) -> float:
    """The worth of a pose by what tells it from others."""
    otherwise = min(0.0, candidate.likeness or 0.0)
    return unhidden(candidate.verification) + agreement(candidate.explained, candidate.moved, otherwise, params)


def unhidden(seen: Verification) -> float:
    """V, had all that is hidden been seen to agree."""
    return seen.score + seen.occluded
