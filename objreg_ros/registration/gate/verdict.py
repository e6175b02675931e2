# SPDX-License-Identifier: Apache-2.0
"""Where a closure is accepted, and the only place.

Fit error, ICP fitness and scores of objects alone all accept wrong poses. The whole view refuses those: free space in
both directions, and the high-passed grey. Agreement of independent evidence refuses most others, observability and
odometry the rest. A false closure is worse than none.
"""

from __future__ import annotations

from collections.abc import Sequence

from objreg_ros.data import Array, Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import spread_of, worst_translation
from objreg_ros.registration.gate import (
    competing,
    convergence,
    free_space,
    gravity,
    lone_object,
    objects,
    observability,
    odometry,
    overlap,
    photometric,
    surroundings,
    view_score,
)
from objreg_ros.registration.gate.limits import LIMITS, Limits
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN, margin_over
from objreg_ros.registration.propose.prior import Prior
from objreg_ros.registration.refine.batch_icp import LEAST_PAIRS

__all__ = ["Refusal", "is_possible", "judge", "refuse"]


def judge(candidates: Sequence[Candidate], prior: Prior | None = None, limits: Limits = LIMITS) -> Candidate | Refusal:
    """The first candidate that no check refuses, or the refusal of the best one.

    ``candidates`` come best first. One whose view score is clearly below the best never stands in for it: when the
    truth is refused, for instance because it could slide, the next best is an alias.
    """
    if not candidates:
        return Reason.NO_HYPOTHESIS, f"no chain proposed a pose, or fewer than {LEAST_PAIRS} points were seen"
    least = candidates[0].verification.score - CONSIDERED_MARGIN
    possible = [one for one in candidates if is_possible(one, limits)]
    refusals = []
    for candidate in candidates:
        if candidate.verification.score < least:
            break
        refusal = refuse(candidate, prior, possible, limits)
        if refusal is None:
            return candidate
        refusals.append(refusal)
    return refusals[0]


def is_possible(candidate: Candidate, limits: Limits = LIMITS) -> bool:
    """Whether a pose may be true for all that is seen: it matches an object, and keeps gravity and free space."""
    one, found = candidate, objects.objects_of(candidate, limits.objects)
    return found.matched > 0 and not (
        gravity.check(one.gravity_error_deg, one.gravity_error_sigmas, limits.gravity_sigmas)
        or free_space.check(one.verification.violations, one.certain_violations, found.doubtful, limits.free_space)
    )


def refuse(
    candidate: Candidate,
    prior: Prior | None = None,
    possible: Sequence[Candidate] = (),
    limits: Limits = LIMITS,
) -> Refusal | None:
    """The first check that refuses a candidate, with its numbers; None if none does. ``possible`` poses compete."""
    one, fit, seen, T = candidate, candidate.alignment, candidate.verification, candidate.T_target_source
    found, labels = objects.objects_of(one, limits.objects), [pair.label for pair in one.matched]
    return (
        convergence.check(fit.converged, fit.inliers)
        or odometry.check_plausible(T, limits.translation_m)
        or gravity.check(one.gravity_error_deg, one.gravity_error_sigmas, limits.gravity_sigmas)
        or overlap.check(seen.tested, seen.inliers, limits.overlap)
        or free_space.check(seen.violations, one.certain_violations, found.doubtful, limits.free_space)
        or free_space.check_few(one.certain_violations, found.few, limits.free_space)
        or photometric.check(seen.texture, found.few, limits.correlation)
        or view_score.check(seen, one.silhouette_score, one.perturbation_margin, found.lone, limits.view_score)
        or objects.check_moved(found.matched, len(one.moved))
        or lone_object.check_overlap(seen.tested, found.lone, limits.lone_object)
        or surroundings.check(one.surroundings, seen, labels, found, limits.surroundings)
        or objects.check_matched(found.matched)
        or _check_competing(one, margin_over(one, possible), limits)
        or lone_object.check_firm(seen.score, one.perturbation_margin, one.yaw_known, found.lone, limits.lone_object)
        or observability.check_directions(len(fit.degenerate))
        or _check_position(one, spread_of(fit) + one.systematic_depth_error, found.uncertain, limits.observability)
        or odometry.check(T, prior, limits.odometry_sigmas)
    )


def _check_competing(one: Candidate, score_margin: float, limits: Limits) -> Refusal | None:
    """Refuse a candidate whose total score is not clearly above that of the competing hypotheses."""
    matched, agreeing = len(one.matched), len(one.agreeing_proposers)
    confirmed = lone_object.is_confirmed(lone_object.appearance_of(one), limits.appearance)
    return competing.check_several(matched, score_margin, limits.competing) or competing.check_lone(
        matched, score_margin, confirmed, agreeing, one.silhouette_score, limits.competing
    )


def _check_position(one: Candidate, covariance: Array, uncertain: bool, limits: observability.Limits) -> Refusal | None:
    """Refuse a candidate of that ``covariance (6, 6)`` whose position neither surfaces nor views hold."""
    sigma_m = worst_translation(covariance)
    range_m = observability.mean_range(one.alignment.middle, one.T_target_source)
    least = observability.least_margin(sigma_m, range_m, uncertain, limits)
    return observability.check(sigma_m, one.perturbation_margin, least, limits)
