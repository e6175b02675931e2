# SPDX-License-Identifier: Apache-2.0
"""The limits of all checks. Each check's file says what its limits are; a user may set two of them.

All are set by hand on one kitchen and on simulation, where a measured false pose needed them (docs/tried.md).
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.registration.gate import (
    competing,
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
from objreg_ros.registration.params import RegistrarParams


class Limits(NamedTuple):
    """What every file of the gate needs; a single number where a check has one."""

    translation_m: float = odometry.FAR_M
    gravity_sigmas: float = gravity.SIGMAS
    objects: objects.Limits = objects.Limits()
    overlap: overlap.Limits = overlap.Limits()
    free_space: free_space.Limits = free_space.Limits()
    correlation: float = photometric.CORRELATED
    view_score: view_score.Limits = view_score.Limits()
    surroundings: surroundings.Limits = surroundings.Limits()
    competing: competing.Limits = competing.Limits()
    appearance: lone_object.AppearanceLimits = lone_object.AppearanceLimits()
    lone_object: lone_object.Limits = lone_object.Limits()
    observability: observability.Limits = observability.Limits()
    odometry_sigmas: float = odometry.SIGMAS


LIMITS = Limits()


def limits_of(params: RegistrarParams) -> Limits:
    """The limits with those that a user set."""
    return LIMITS._replace(
        translation_m=params.max_translation,
        free_space=LIMITS.free_space._replace(violations=params.max_violations),
        surroundings=LIMITS.surroundings._replace(violations=params.max_violations),
    )
