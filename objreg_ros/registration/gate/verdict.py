# SPDX-License-Identifier: Apache-2.0
"""Where a closure is accepted, and the only place.

All that is seen is weighed together, and a pose is accepted where the odds are high that it is right. A few rules stand
beside: what they refuse was seen to be false however likely it looked, or is no pose of one place. A false closure is
worse than none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate import (
    competing,
    convergence,
    free_space,
    gravity,
    likelihood,
    objects,
    observability,
    odometry,
    surroundings,
)
from objreg_ros.registration.gate.limits import LIMITS, Limits
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN, margin_over
from objreg_ros.registration.propose.prior import Prior
from objreg_ros.registration.refine.batch_icp import LEAST_PAIRS

__all__ = ["Refusal", "check_possible", "check_rules", "compared", "judge", "refuse"]


def judge(candidates: Sequence[Candidate], prior: Prior | None = None, limits: Limits = LIMITS) -> Candidate | Refusal:
    """The first candidate that nothing refuses, or the refusal of the best one.

    ``candidates`` come best first. One whose view score is clearly below the best never stands in for it: when the
    truth is refused, for instance because it could slide, the next best is an alias.
    """
    if not candidates:
        return Reason.NO_HYPOTHESIS, f"no chain proposed a pose, or fewer than {LEAST_PAIRS} points were seen"
    least = candidates[0].verification.score - CONSIDERED_MARGIN
    refusals = []
    for candidate in compared(candidates, limits):
        if candidate.verification.score < least:
            break
        refusal = refuse(candidate, prior, limits)
        if refusal is None:
            return candidate
        refusals.append(refusal)
    return refusals[0]


def compared(candidates: Sequence[Candidate], limits: Limits = LIMITS) -> list[Candidate]:
    """The candidates with their margins over those only that keep gravity: the others are no poses of one room."""
    possible = [one for one in candidates if _check_gravity(one, limits) is None]
    return [replace(one, score_margin=margin_over(one, possible)) for one in candidates]


def refuse(one: Candidate, prior: Prior | None = None, limits: Limits = LIMITS) -> Refusal | None:
    """The first rule that refuses a candidate, or too small odds, with the numbers; None if nothing does."""
    return check_rules(one, prior, limits) or likelihood.check(one, limits.odds)


def check_rules(one: Candidate, prior: Prior | None = None, limits: Limits = LIMITS) -> Refusal | None:
    """The first rule that refuses a candidate however likely it looks, with the numbers; None if none does."""
    return check_possible(one, prior, limits) or check_alone(one, limits)


def check_possible(one: Candidate, prior: Prior | None = None, limits: Limits = LIMITS) -> Refusal | None:
    """The first rule by which a candidate is no pose of one place, whatever others say; None if it may be one."""
    return (
        convergence.check(one.alignment.converged, one.alignment.inliers)
        or odometry.check_plausible(one.T_target_source, limits.translation_m)
        or _check_gravity(one, limits)
        or free_space.check(one.verification.violations, one.certain_violations, one.keypoints, limits.free_space)
        or objects.check_moved(objects.counted(one.matched), objects.counted(one.moved))
        or odometry.check(one.T_target_source, prior, limits.odometry_sigmas)
    )


def check_alone(one: Candidate, limits: Limits = LIMITS) -> Refusal | None:
    """The first rule by which a candidate does not stand by itself: poses that agree with it may confirm it."""
    labels = [pair.label for pair in one.matched]
    return (
        objects.check_matched(one.matched, limits.unnamed)
        or surroundings.check(
            one.surroundings, one.verification, labels, objects.is_lone(one.matched), limits.surroundings
        )
        or competing.check(one.score_margin, limits.score_margin)
        or observability.check(len(one.alignment.degenerate))
    )


def _check_gravity(one: Candidate, limits: Limits) -> Refusal | None:
    return gravity.check(one.gravity_error_deg, one.gravity_error_sigmas, limits.gravity_sigmas)
