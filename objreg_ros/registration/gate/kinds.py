# SPDX-License-Identifier: Apache-2.0
"""The kinds of evidence that the likelihood weighs: how each is read, and between which values its weight changes.

A reading is a plain number, or None where it is not known. It is published under the name of its kind. Depth tolerances
have grown with the noise of the cameras before anything is read (`objreg_ros/sensor.py`), so a reading means the same
for every camera. What a reading weighs is fitted (`weights`); here stands only its direction: a weight never falls
where the evidence gets better.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log10
from typing import NamedTuple

import numpy as np

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of, spread_of, worst_translation
from objreg_ros.registration.gate.objects import counted, independent
from objreg_ros.registration.params import RegistrationParams


class Kind(NamedTuple):
    """One kind of evidence."""

    read: Callable[[Candidate], float | None]
    knots: tuple[float, ...]  # ascending readings between which the weight is linear; it is constant beyond
    rises: bool  # whether more of it supports a pose
    reason: Reason  # of a refusal for want of it
    phrase: str  # what a refusal calls it
    scaled: Callable[[float], float] = float  # from a reading to what the knots are in


AS_CALIBRATED = RegistrationParams(covariance_calibration=0.01)  # a camera's own; a user's changes no verdict


def _position_sigma(one: Candidate) -> float:
    """The deviation in m of the position along its worst direction, by residuals and systematic depth errors."""
    return worst_translation(spread_of(one.alignment) + one.systematic_depth_error)


def _scaled_sigma(one: Candidate) -> float:
    """The same by residuals alone, with what V and their size say of what they do not show."""
    return worst_translation(covariance_of(one, AS_CALIBRATED))


def _decimal_logarithm(count: float) -> float:
    return log10(max(1.0, count))


def _range(one: Candidate) -> float:
    """The mean distance in m of both cameras from the middle of what is seen."""
    middle, eye = one.alignment.middle, one.T_target_source[:3, 3]
    return float(np.linalg.norm(middle) + np.linalg.norm(middle - eye)) / 2.0


KINDS = {
    "tested": Kind(
        lambda one: float(one.verification.tested),
        (2.8, 3.0, 3.3, 3.7, 4.2), True, Reason.LOW_OVERLAP, "pixels that both views see", _decimal_logarithm,
    ),
    "certain_violations": Kind(
        lambda one: one.certain_violations,
        (0.0, 0.001, 0.003, 0.006, 0.012, 0.025), False, Reason.FREE_SPACE, "certain violations",
    ),
    "correlation": Kind(
        lambda one: one.verification.correlation,
        (-0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65), True, Reason.TEXTURE, "correlation of grey",
    ),
    "silhouettes": Kind(
        lambda one: one.silhouettes,
        (-0.5, -0.2, 0.0, 0.2, 0.5), True, Reason.PROPOSERS_DISAGREE, "silhouette score",
    ),
    "matched": Kind(
        lambda one: counted(one.matched),
        (0.0, 1.0, 2.0, 3.0, 4.0, 6.0), True, Reason.FEW_OBJECTS, "matched objects",
    ),
    "proposers": Kind(
        lambda one: float(independent(one.agreeing_proposers)),
        (1.0, 2.0, 3.0), True, Reason.PROPOSERS_DISAGREE, "independent proposers",
    ),
    "score_margin": Kind(
        lambda one: one.score_margin,
        (-0.2, 0.0, 0.1, 0.2, 0.3, 0.45, 0.7, 1.0), True, Reason.PROPOSERS_DISAGREE, "lead over another possible pose",
    ),
    "perturbation_margin": Kind(
        lambda one: one.perturbation_margin,
        (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6), True, Reason.SLACK, "fall of V over a perturbation",
    ),
    "position_sigma": Kind(
        _position_sigma,
        (0.005, 0.01, 0.02, 0.03, 0.06), False, Reason.SLACK, "deviation of the position in m",
    ),
    "scaled_sigma": Kind(
        _scaled_sigma,
        (0.005, 0.01, 0.02, 0.03, 0.05, 0.1), False, Reason.SLACK, "deviation of the position by residuals and V in m",
    ),
    "rmse": Kind(
        lambda one: one.alignment.rmse,
        (0.004, 0.007, 0.01, 0.014, 0.02), False, Reason.LOW_OVERLAP, "rmse of the surfaces in m",
    ),
    "range": Kind(_range, (1.5, 2.0, 2.5, 3.0, 3.5, 4.0), False, Reason.SLACK, "distance of what is seen in m"),
}  # fmt: skip
"""By name. ``score_margin`` is that over the poses which may be true: `verdict` sets it before it asks."""


def readings_of(candidate: Candidate) -> dict[str, float | None]:
    """What every kind of evidence says of a candidate."""
    return {name: kind.read(candidate) for name, kind in KINDS.items()}
