# SPDX-License-Identifier: Apache-2.0
"""View score: what free space and grey of both views say together."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.gate.observability import FIRM_MARGIN
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.score.comparison import SILHOUETTE_WEIGHT
from objreg_ros.registration.score.view_score import LEAST_SCORE


class Limits(NamedTuple):
    """View scores, unless another unit is given."""

    least: float = LEAST_SCORE  # of any pose
    least_doubtful: float = 0.40  # with the silhouettes, of a doubtful pose
    violations: float = 0.02  # share of the tested pixels in seen free space; more make a pose doubtful
    firm_margin: float = FIRM_MARGIN  # margin under perturbation of a pose that is not doubtful
    silhouette_weight: float = SILHOUETTE_WEIGHT  # what a silhouette score of 1 adds


def check(
    seen: Verification, silhouette_score: float | None, perturbation_margin: float | None, lone: bool, limits: Limits
) -> Refusal | None:
    """Refuse a pose with a low view score, and a doubtful one whose silhouettes do not make up for it.

    Silhouettes that differ take nothing from the view score.
    """
    least = least_total(seen.violations, perturbation_margin, lone, limits)
    return _check_views(seen.score, limits.least) or _check_total(
        seen.score + limits.silhouette_weight * max(0.0, silhouette_score or 0.0), least
    )


def least_total(violations: float, perturbation_margin: float | None, lone: bool, limits: Limits) -> float:
    """The least view score with silhouettes: higher for a pose with free-space violations.

    A margin under perturbation makes up for violations: a pose that the views hold firmly is not doubtful. A ``lone``
    object's pose that was not perturbed (margin None) is doubtful always; `lone_object.check_firm` asks the others.
    """
    if perturbation_margin is None:
        return limits.least_doubtful if lone else limits.least
    if violations <= limits.violations:
        return limits.least
    return min(limits.least_doubtful, limits.least + max(0.0, limits.firm_margin - perturbation_margin))


def _check_views(score: float, least: float) -> Refusal | None:
    if score >= least:
        return None
    return Reason.LOW_OVERLAP, f"score {score:.2f} < {least:.2f}"


def _check_total(total: float, least: float) -> Refusal | None:
    if total >= least:
        return None
    return Reason.LOW_OVERLAP, f"score with likeness {total:.2f} < {least:.2f}"
