# SPDX-License-Identifier: Apache-2.0
"""The limits, and which of them a user sets."""

from __future__ import annotations

import pytest

from objreg_ros.registration.gate.limits import LIMITS, limits_of
from objreg_ros.registration.params import RegistrarParams

VALUES = {
    "translation_m": 5.0,
    "gravity_sigmas": 3.5,
    "objects.many": 3,
    "objects.proposers": 2,
    "objects.silhouette_score": 0.0,
    "overlap.tested": 600,
    "overlap.inliers": 0.35,
    "free_space.violations": 0.07,
    "free_space.certain_doubtful": 0.012,
    "free_space.certain_few": 0.015,
    "correlation": 0.3,
    "view_score.least": 0.1,
    "view_score.least_doubtful": 0.4,
    "view_score.violations": 0.02,
    "view_score.firm_margin": 0.4,
    "view_score.silhouette_weight": 0.5,
    "surroundings.overlap.tested": 600,
    "surroundings.overlap.inliers": 0.35,
    "surroundings.violations": 0.07,
    "surroundings.correlation": 0.3,
    "surroundings.correlation_loss": 0.25,
    "surroundings.share": 0.15,
    "competing.objects": 2,
    "competing.several_margin": 0.1,
    "competing.lone_margin": 0.2,
    "appearance.silhouette_score": 0.1,
    "appearance.silhouette_score_with_grey": -0.2,
    "appearance.correlation": 0.5,
    "appearance.score_margin": 0.45,
    "lone_object.tested": 2000,
    "lone_object.firmness": 1.0,
    "lone_object.yaw_bonus": 0.25,
    "lone_object.objects": 2,
    "lone_object.proposers": 2,
    "observability.sigma_m": 0.03,
    "observability.range_m": 2.5,
    "observability.least_margin": 0.1,
    "observability.firm_margin": 0.4,
    "observability.uncertain_factor": 1.5,
    "observability.perturbation_m": 0.15,
    "odometry_sigmas": 4.0,
}


def test_no_limit_changes_unnoticed() -> None:
    assert flat(LIMITS) == VALUES


def test_a_user_who_sets_nothing_has_the_limits_as_they_are() -> None:
    assert limits_of(RegistrarParams()) == LIMITS


@pytest.mark.parametrize(
    ("name", "value", "places"),
    [
        ("max_translation", 3.0, {"translation_m"}),
        ("max_violations", 0.33, {"free_space.violations", "surroundings.violations"}),
    ],
)
def test_a_parameter_sets_its_limits_and_no_other(name: str, value: float, places: set[str]) -> None:
    limits = flat(limits_of(RegistrarParams(**{name: value})))
    assert limits == VALUES | dict.fromkeys(places, value)


def flat(limits: object, prefix: str = "") -> dict[str, float]:
    """Every number by its dotted name."""
    found: dict[str, float] = {}
    for name, value in limits._asdict().items():
        found |= flat(value, f"{prefix}{name}.") if hasattr(value, "_asdict") else {f"{prefix}{name}": value}
    return found
