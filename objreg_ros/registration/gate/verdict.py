# SPDX-License-Identifier: Apache-2.0
"""Where a closure is accepted, and the only place.

Fit error, ICP fitness and scores of objects alone all accept wrong poses. What refuses them is the whole view: free
space looked at both ways and the high-passed grey, then agreement of independent evidence, then what cannot be.
Publishing nothing is better than a false closure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from objreg_ros.data import Reason
from objreg_ros.geometry import pose_error
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import spread_of, worst_translation
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.propose.evidence import lead
from objreg_ros.registration.propose.prior import Prior

Refusal = tuple[Reason, str]

SAME_EVIDENCE = {"centroids": "objects", "odometry": "objects"}
"""Chains that are one where they agree: poses of objects are looked for from those that their middles propose too, and
what drifting odometry expects is refined to whatever the objects fit nearby, right or wrong."""


def judge(candidates: Sequence[Candidate], params: RegistrarParams, prior: Prior | None = None) -> Candidate | Refusal:
    """The first candidate that nothing speaks against, or the refusal of the best one.

    A candidate that the views like clearly less than the best never stands in for it: when the truth is refused, for
    instance because it could slide, the next best is an alias.
    """
    if not candidates:
        return Reason.NO_HYPOTHESIS, f"no chain proposed a pose, or fewer than {params.min_points} points were seen"
    refusals = []
    best, rivals = candidates[0].verification.score, [one for one in candidates if is_possible(one, params)]
    for candidate in candidates:
        if candidate.verification.score < best - params.rival_margin:
            break
        refusal = refuse(candidate, params, prior, rivals)
        if refusal is None:
            return candidate
        refusals.append(refusal)
    return refusals[0]


def refuse(
    candidate: Candidate, params: RegistrarParams, prior: Prior | None = None, rivals: Sequence[Candidate] = ()
) -> Refusal | None:
    """Why this candidate is no closure, with the numbers; None if it is one. ``rivals`` are the possible others."""
    checks: list[Check] = [*CHECKS, partial(_agreement, rivals=rivals), _firm, _held]
    if prior is not None:
        checks.append(partial(_odometry, prior=prior))
    refusals = (check(candidate, params) for check in checks)
    return next((refusal for refusal in refusals if refusal is not None), None)


def is_possible(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether a pose may be the true one for all that is seen: it explains an object, keeps gravity and free space."""
    return bool(candidate.explained) and not any(check(candidate, params) for check in (_gravity, _free_space))


def _converged(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    if candidate.alignment.converged:
        return None
    return Reason.NOT_CONVERGED, f"{candidate.alignment.inliers} points find a partner"


def _plausible(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    moved = float(np.linalg.norm(candidate.T_target_source[:3, 3]))
    if moved <= params.max_translation:
        return None
    return Reason.IMPLAUSIBLE_MOTION, f"{moved:.2f} m > {params.max_translation:.2f} m"


def _gravity(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    error = candidate.gravity_error_deg
    if error is None or error <= params.max_gravity_error:
        return None
    return Reason.GRAVITY, f"{error:.1f} deg > {params.max_gravity_error:.1f} deg"


def _overlap(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    seen = candidate.verification
    if seen.tested < params.min_tested:
        return Reason.LOW_OVERLAP, f"{seen.tested} pixels tested < {params.min_tested}"
    if seen.inliers < params.min_inliers:
        return Reason.LOW_OVERLAP, f"inliers {seen.inliers:.2f} < {params.min_inliers:.2f}"
    return None


def _enough(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """The views must see more of the same where one object alone speaks for the pose, by one chain."""
    tested = candidate.verification.tested
    if not _is_alone(candidate, params) or tested >= params.min_tested_alone:
        return None
    return Reason.LOW_OVERLAP, f"1 object and {tested} pixels tested < {params.min_tested_alone}"


def _free_space(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """Stricter for a lone object: a half turn about it is seen in free space alone, by what floats beyond doubt.

    And for several that look otherwise: they stand where others stood.
    """
    violations, floating = candidate.verification.violations, candidate.floating
    if violations > params.max_violations:
        return Reason.FREE_SPACE, f"violations {violations:.3f} > {params.max_violations:.3f}"
    doubtful = len(candidate.explained) < 2 or _several_otherwise(candidate, params)
    if doubtful and floating > params.max_floating_alone:
        return Reason.FREE_SPACE, f"{floating:.3f} float > {params.max_floating_alone:.3f}"
    return None


def _unmoved(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """Two objects may have moved together, and be most of what is seen: then what stayed floats. Three stayed."""
    few, floating = len(candidate.explained) < params.min_objects_plain, candidate.floating
    if few and floating > params.max_floating:
        return Reason.FREE_SPACE, f"{floating:.3f} float > {params.max_floating:.3f}"
    return None


def _texture(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """The print must be that of the other view; a plain table has none, but several objects stand where they should."""
    texture, several = candidate.verification.texture, len(candidate.explained) >= params.min_objects_plain
    least = min(0.0, params.min_texture) if several else params.min_texture
    if texture is None or texture >= least:
        return None
    return Reason.TEXTURE, f"correlation {texture:.2f} < {least:.2f}"


def _score(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """The views must like the pose; more, or its objects do, where it is doubtful."""
    score, liked = candidate.verification.score, _least_liked(candidate, params)
    if score < params.min_score:
        return Reason.LOW_OVERLAP, f"score {score:.2f} < {params.min_score:.2f}"
    with_likeness = score + params.likeness_weight * max(0.0, candidate.likeness or 0.0)
    if with_likeness >= liked:
        return None
    return Reason.LOW_OVERLAP, f"score with likeness {with_likeness:.2f} < {liked:.2f}"


def _least_liked(candidate: Candidate, params: RegistrarParams) -> float:
    """What views and objects must like of a pose: more where something floats, or a lone object's was not pushed.

    For what floats makes up by how much worse a push is: a pose that the views hold firmly is not doubtful. So does
    `_firm` for a lone object's.
    """
    drop, violated = candidate.resistance, candidate.verification.violations > params.max_violations_doubtful
    if drop is None and _is_alone(candidate, params):
        return params.min_score_doubtful
    if drop is None or not violated:
        return params.min_score
    return min(params.min_score_doubtful, params.min_score + max(0.0, params.firm_margin - drop))


def _is_alone(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether at most one object lies upon itself under the pose, and fewer chains than should came to it."""
    return len(candidate.explained) < 2 and _few_chains(candidate, params)


def _few_chains(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether fewer independent chains than should came to the pose."""
    return len({SAME_EVIDENCE.get(chain, chain) for chain in candidate.agreeing_chains}) < params.min_chains


def _firm(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """A lone object's pose that too few chains came to must be liked by the views, and every push of it less.

    An object that tells its yaw speaks for it too. A pose that surfaces hold within ``doubtful_sigma`` was not pushed,
    as it needs no views to hold it.
    """
    score, drop = candidate.verification.score, candidate.resistance
    if drop is None or not _is_alone(candidate, params):
        return None
    least = params.min_firmness_alone - params.object_bonus * candidate.yaw_known
    if score + drop >= least:
        return None
    return Reason.CHAINS_DISAGREE, (
        f"1 object < {params.min_objects} and fewer than {params.min_chains} chains, score {score:.2f} and its fall "
        f"over a push {drop:.2f} make less than {least:.2f}"
    )


def _agreement(candidate: Candidate, params: RegistrarParams, rivals: Sequence[Candidate]) -> Refusal | None:
    """Several objects, or one whose pose has no rival, and that does not look otherwise or has the views' grey for it.

    Nor may the pose of several have a rival that is worth as much: one of the two is wrong.

    Without an object rooms that repeat themselves look alike. So do plain rooms with one object of a kind in them:
    chains agree on it, and an object that tells no yaw, or is seen to look otherwise, does not confirm them.
    """
    chains, explained = len(candidate.agreeing_chains), len(candidate.explained)
    if explained == 0:
        return Reason.FEW_OBJECTS, "0 objects < 1"
    margin = lead(candidate, rivals, params)
    if explained >= params.min_objects:
        told = f"{explained} objects, another possible pose is worth {margin:.2f} < {params.rival_margin:.2f} less"
        return None if margin >= params.rival_margin else (Reason.CHAINS_DISAGREE, told)
    confirmed = any(check(candidate, params) for check in (_not_otherwise, _painted))
    if margin >= params.min_margin_alone and confirmed:
        return None
    return Reason.CHAINS_DISAGREE, (
        f"{explained} objects < {params.min_objects}, {chains} chains, "
        f"likeness {candidate.likeness or 0.0:.2f}, margin {margin:.2f}"
    )


def _not_otherwise(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether the object does not look otherwise, and tells the yaw, or the grey of the views does beyond doubt."""
    likeness, texture = candidate.likeness, candidate.verification.texture
    least = params.min_likeness_alone if texture is None else params.min_likeness_unrivalled
    told = candidate.yaw_known or (texture is not None and texture >= params.min_texture_painted)
    return likeness is not None and likeness >= least and told


def _painted(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether the grey of the views confirms the pose, and no other comes anywhere near it, possible or not."""
    texture = candidate.verification.texture
    correlates = texture is not None and texture >= params.min_texture_painted
    return correlates and candidate.margin >= params.min_margin_painted


def _stationary(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """What moved is outvoted by what stayed; if most moved, nothing is known."""
    moved, stayed = len(candidate.moved), len(candidate.explained)
    if moved <= stayed:
        return None
    return Reason.MOVED, f"{moved} objects moved, {stayed} stayed"


def _held(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """Whether the pose is known: the worse by its covariance, the more the views must like a push less.

    The covariance is that of the residuals and of a warped depth, less what views and gravity tell: two views may share
    few patches on one side, which agree with many poses. A camera that goes sideways and turns to keep looking at one
    far thing sees next to no difference. Where a turn or a shift is held by neither the surfaces nor the views, nor by
    an object that tells its yaw and looks alike, nothing is known of it, however firmly the rest is held.
    """
    free = len(candidate.alignment.slack)
    if free:
        return Reason.SLACK, f"{free} of 6 directions held by nothing"
    sigma, drop = worst_translation(spread_of(candidate.alignment, params) + candidate.warp), candidate.resistance
    least = _least_fall(candidate, sigma, params)
    if drop is None and sigma > params.max_slack_sigma:
        return Reason.SLACK, f"sigma {sigma:.3f} m > {params.max_slack_sigma:.3f} m, not pushed"
    if drop is None or drop >= least:
        return None
    return Reason.SLACK, f"sigma {sigma:.3f} m, V falls by {drop:.2f} < {least:.2f} over {params.pushes[-1]:.2f} m"


def _least_fall(candidate: Candidate, sigma: float, params: RegistrarParams) -> float:
    """What V must fall by over a push of a position that the surfaces know to ``sigma`` m.

    V falls with the square of a push, so it grows with the variance, up to where the views by themselves hold the pose
    firmly: then it is known, however badly the surfaces know it. It grows with the square of the distance of what is
    seen, too, from either camera: from afar a shift and a turn look alike, and depth is known as badly. Several objects
    that look otherwise leave more to the views, and so do two that one chain brought together; a lone one has checks of
    its own.
    """
    middle, eye = candidate.alignment.middle, candidate.T_target_source[:3, 3]
    range_m = float(np.linalg.norm(middle) + np.linalg.norm(middle - eye)) / 2.0
    loose = max(1.0, sigma / params.max_slack_sigma, range_m / params.far_range)
    least = max(params.rival_margin, min(params.firm_margin, params.rival_margin * loose**2))
    two = 2 <= len(candidate.explained) < params.min_objects_plain and _few_chains(candidate, params)
    return least * (params.doubt_factor if two or _several_otherwise(candidate, params) else 1.0)


def _several_otherwise(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether several objects look otherwise, even a little aside: they stand where others stood.

    A lone one is not given that much: aside, a small thing meets nothing and looks neither alike nor otherwise.
    """
    likeness = candidate.likeness_nearby
    return len(candidate.explained) > 1 and likeness is not None and likeness < params.min_likeness_several


def _surroundings(candidate: Candidate, params: RegistrarParams) -> Refusal | None:
    """What is around a lone object, or around two, must pass by itself what whole views do: they may have moved.

    Its print may not agree much less than that of the whole either: what moved carries its own along. Around a lone one
    there must be enough of it, too, where fewer chains than should came to the pose.
    """
    around, seen = candidate.surroundings, candidate.verification
    if around is None:
        return None
    beside = f"without the {' and the '.join(pair.label for pair in candidate.explained)}"
    if _is_alone(candidate, params) and around.tested < params.min_surroundings * seen.tested:
        return Reason.LOW_OVERLAP, f"{beside} {around.tested} pixels < {params.min_surroundings:.2f} of {seen.tested}"
    rest = replace(candidate, verification=around)
    checks: tuple[Check, ...] = (_overlap, _free_space, _texture, partial(_carried, whole=seen.texture))
    refusals = (check(rest, params) for check in checks)
    return next(((reason, f"{beside} {told}") for reason, told in filter(None, refusals)), None)


def _carried(rest: Candidate, params: RegistrarParams, whole: float | None) -> Refusal | None:
    """Whether the print agrees much less than that of the ``whole`` once objects are left out."""
    texture = rest.verification.texture
    if texture is None or whole is None or whole - texture <= params.max_fall_around:
        return None
    return Reason.TEXTURE, f"correlation {texture:.2f} < {whole:.2f} by more than {params.max_fall_around:.2f}"


def _odometry(candidate: Candidate, params: RegistrarParams, prior: Prior) -> Refusal | None:
    rotation, translation = pose_error(candidate.T_target_source, prior.T_target_source)
    most_rotation = params.odometry_sigmas * prior.rotation_deg
    most_translation = params.odometry_sigmas * 100.0 * prior.translation_m
    if not prior.trusted or (rotation <= most_rotation and translation <= most_translation):
        return None
    return Reason.ODOMETRY, (
        f"{rotation:.1f} deg {translation:.0f} cm from odometry, "
        f"expected {most_rotation:.1f} deg {most_translation:.0f} cm at most"
    )


Check = Callable[[Candidate, RegistrarParams], Refusal | None]
CHECKS: tuple[Check, ...] = (  # of a candidate alone, before what others and odometry say
    _converged,
    _plausible,
    _gravity,
    _overlap,
    _free_space,
    _unmoved,
    _texture,
    _score,
    _stationary,
    _enough,
    _surroundings,
)
