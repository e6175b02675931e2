# SPDX-License-Identifier: Apache-2.0
"""The numbers of the gate, of which a user may set the least odds and the largest motion."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.registration.gate import competing, free_space, gravity, likelihood, objects, odometry, surroundings
from objreg_ros.registration.params import RegistrationParams


class Limits(NamedTuple):
    """What the likelihood and the rules beside it ask for."""

    odds: float = likelihood.ODDS
    translation_m: float = odometry.FAR_M
    gravity_sigmas: float = gravity.SIGMAS
    unnamed: int = objects.LEAST_UNNAMED
    free_space: free_space.FreeSpaceLimits = free_space.LIMITS
    surroundings: surroundings.SurroundingsLimits = surroundings.LIMITS
    score_margin: float = competing.LEAST_MARGIN
    odometry_sigmas: float = odometry.SIGMAS


LIMITS = Limits()


def limits_of(params: RegistrationParams) -> Limits:
    """The limits with those that a user set."""
    return LIMITS._replace(odds=params.least_odds, translation_m=params.max_translation)
