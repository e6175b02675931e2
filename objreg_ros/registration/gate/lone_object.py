# SPDX-License-Identifier: Apache-2.0
"""A lone object: one matched object. Most false poses that were met have a lone one, by too few independent proposers.

Plain rooms with one object of a kind look the same, and a half turn of the object shows only by its appearance.
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.objects import PROPOSERS, SEVERAL
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.propose.evidence import OBJECT_BONUS


class Limits(NamedTuple):
    """What is asked of a lone object's pose."""

    tested: int = 2000  # least number of pixels that both views see
    firmness: float = 1.0  # least view score with its margin under perturbation
    yaw_bonus: float = OBJECT_BONUS  # how much less firmness an object needs that tells its yaw
    objects: int = SEVERAL  # matched objects that are not lone, as the refusal says
    proposers: int = PROPOSERS  # independent proposers that make up for a second object, as the refusal says


class AppearanceLimits(NamedTuple):
    """What confirms a lone object's pose: the least of each."""

    silhouette_score: float = 0.1  # without grey
    silhouette_score_with_grey: float = -0.2
    correlation: float = 0.5  # of grey that tells the yaw, or confirms the pose by itself
    score_margin: float = 0.45  # total score over any other pose, where grey confirms the pose by itself


class Appearance(NamedTuple):
    """How a lone object and what is around it look under a pose."""

    silhouette_score: float | None  # -1..1, None where unknown
    yaw_known: bool  # the shape tells the yaw
    correlation: float | None  # of the high-passed grey of the views, None without grey
    score_margin: float  # total score over any other pose, possible or not


def check_overlap(tested: int, lone: bool, limits: Limits) -> Refusal | None:
    """Refuse a ``lone`` object's pose under which both views see few pixels."""
    if not lone or tested >= limits.tested:
        return None
    return Reason.LOW_OVERLAP, f"1 object and {tested} pixels tested < {limits.tested}"


def check_firm(
    score: float, perturbation_margin: float | None, yaw_known: bool, lone: bool, limits: Limits
) -> Refusal | None:
    """Refuse a ``lone`` object's pose whose view score is low, or falls little over a perturbation.

    A pose that surfaces hold is not perturbed (margin None), as it needs no views to hold it.
    """
    least = limits.firmness - limits.yaw_bonus * yaw_known
    if not lone or perturbation_margin is None or score + perturbation_margin >= least:
        return None
    return Reason.CHAINS_DISAGREE, (
        f"1 object < {limits.objects} and fewer than {limits.proposers} chains, score {score:.2f} and its fall "
        f"over a push {perturbation_margin:.2f} make less than {least:.2f}"
    )


def appearance_of(candidate: Candidate) -> Appearance:
    """The appearance of the object of a candidate."""
    correlation = candidate.verification.texture
    return Appearance(candidate.silhouette_score, candidate.yaw_known, correlation, candidate.margin_over_competing)


def is_confirmed(look: Appearance, limits: AppearanceLimits) -> bool:
    """Whether the object or the grey confirms the pose."""
    return _by_object(look, limits) or _by_grey(look, limits)


def _by_object(look: Appearance, limits: AppearanceLimits) -> bool:
    """Whether the silhouette does not differ, and the object tells the yaw, or the grey does beyond doubt."""
    without_grey = look.correlation is None
    least = limits.silhouette_score if without_grey else limits.silhouette_score_with_grey
    consistent = look.silhouette_score is not None and look.silhouette_score >= least
    return consistent and (look.yaw_known or _correlates(look, limits))


def _by_grey(look: Appearance, limits: AppearanceLimits) -> bool:
    """Whether the grey correlates, and no other pose comes near, possible or not."""
    return _correlates(look, limits) and look.score_margin >= limits.score_margin


def _correlates(look: Appearance, limits: AppearanceLimits) -> bool:
    return look.correlation is not None and look.correlation >= limits.correlation
