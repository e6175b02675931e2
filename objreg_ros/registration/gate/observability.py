# SPDX-License-Identifier: Apache-2.0
"""Observability: whether surfaces and views hold the pose in every direction.

The deviation is that of the residuals and of a systematic depth error, less what views and gravity tell. Two views may
share few patches on one side, which agree with many poses. A camera that goes sideways and turns to keep looking at one
far thing sees next to no difference. So a badly known position must lose view score when it is perturbed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data import Array, Reason
from objreg_ros.registration.certainty.observability import CLEAR_MARGIN, PERTURBATIONS_M
from objreg_ros.registration.gate.refusal import Refusal

FIRM_MARGIN = 0.4  # fall of V over a perturbation from which on the views alone hold a pose
DIRECTIONS = 6  # of a pose


class Limits(NamedTuple):
    """What a pose must be held by; margins are of the view score under perturbation."""

    sigma_m: float = 0.03  # deviation of the position, beyond which the margin must grow
    range_m: float = 2.5  # mean distance of what is seen, beyond which the margin must grow
    least_margin: float = CLEAR_MARGIN
    firm_margin: float = FIRM_MARGIN  # from which on the views hold a pose however badly surfaces know it
    uncertain_factor: float = 1.5  # how many times the margin, where the objects are uncertain
    perturbation_m: float = PERTURBATIONS_M[-1]  # the largest perturbation, as the refusal says


def check_directions(unobservable: int) -> Refusal | None:
    """Refuse a pose with directions that neither surfaces, views nor an object hold, however firm the rest is."""
    if unobservable == 0:
        return None
    return Reason.SLACK, f"{unobservable} of {DIRECTIONS} directions held by nothing"


def check(sigma_m: float, perturbation_margin: float | None, least: float, limits: Limits) -> Refusal | None:
    """Refuse a position known to ``sigma_m`` whose margin under perturbation is below ``least``.

    A pose that was not perturbed (margin None) must be known by its surfaces.
    """
    if perturbation_margin is None:
        if sigma_m <= limits.sigma_m:
            return None
        return Reason.SLACK, f"sigma {sigma_m:.3f} m > {limits.sigma_m:.3f} m, not pushed"
    if perturbation_margin >= least:
        return None
    return Reason.SLACK, (
        f"sigma {sigma_m:.3f} m, V falls by {perturbation_margin:.2f} < {least:.2f} over {limits.perturbation_m:.2f} m"
    )


def least_margin(sigma_m: float, range_m: float, uncertain: bool, limits: Limits) -> float:
    """The least margin under perturbation of a position that surfaces know to ``sigma_m``.

    The view score falls with the square of a perturbation, so the margin grows with the variance, up to the firm one.
    It grows with the square of the distance too: from afar a shift and a turn look the same, and depth is known as
    badly. ``uncertain`` objects leave more to the views; a lone object has checks of its own.
    """
    growth = max(1.0, sigma_m / limits.sigma_m, range_m / limits.range_m) ** 2
    least = max(limits.least_margin, min(limits.firm_margin, limits.least_margin * growth))
    return least * (limits.uncertain_factor if uncertain else 1.0)


def mean_range(middle: Array, T_target_source: Array) -> float:
    """The mean distance in m of both cameras from the ``middle (3,)`` of what is seen, in the target camera."""
    eye = T_target_source[:3, 3]
    return float(np.linalg.norm(middle) + np.linalg.norm(middle - eye)) / 2.0
