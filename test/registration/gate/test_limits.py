# SPDX-License-Identifier: Apache-2.0
"""The limits, made from the parameters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_ros.registration.gate.limits import limits_of
from objreg_ros.registration.params import RegistrarParams


@pytest.mark.parametrize(
    ("name", "value", "places"),
    [
        ("max_translation", 3.0, "translation_m"),
        ("max_gravity_error", 9.0, "gravity_deg"),
        ("min_objects_plain", 7, "objects.many"),
        ("min_chains", 5, "objects.proposers lone_object.proposers"),
        ("min_likeness_several", 0.33, "objects.silhouette_score"),
        ("min_tested", 77, "overlap.tested surroundings.overlap.tested"),
        ("min_inliers", 0.77, "overlap.inliers surroundings.overlap.inliers"),
        ("max_violations", 0.33, "free_space.violations surroundings.violations"),
        ("max_floating_alone", 0.33, "free_space.certain_doubtful"),
        ("max_floating", 0.33, "free_space.certain_few"),
        ("min_texture", 0.33, "correlation surroundings.correlation"),
        ("min_score", 0.33, "view_score.least"),
        ("min_score_doubtful", 0.66, "view_score.least_doubtful"),
        ("max_violations_doubtful", 0.33, "view_score.violations"),
        ("firm_margin", 0.66, "view_score.firm_margin observability.firm_margin"),
        ("likeness_weight", 0.33, "view_score.silhouette_weight"),
        ("max_fall_around", 0.33, "surroundings.correlation_loss"),
        ("min_surroundings", 0.33, "surroundings.share"),
        ("min_objects", 5, "competing.objects lone_object.objects"),
        ("rival_margin", 0.33, "competing.several_margin observability.least_margin"),
        ("min_margin_alone", 0.33, "competing.lone_margin"),
        ("min_likeness_alone", 0.33, "appearance.silhouette_score"),
        ("min_likeness_unrivalled", 0.33, "appearance.silhouette_score_with_grey"),
        ("min_texture_painted", 0.33, "appearance.correlation"),
        ("min_margin_painted", 0.33, "appearance.score_margin"),
        ("min_tested_alone", 77, "lone_object.tested"),
        ("min_firmness_alone", 0.33, "lone_object.firmness"),
        ("object_bonus", 0.33, "lone_object.yaw_bonus"),
        ("max_slack_sigma", 0.33, "observability.sigma_m"),
        ("far_range", 9.0, "observability.range_m"),
        ("doubt_factor", 3.0, "observability.uncertain_factor"),
        ("odometry_sigmas", 9.0, "odometry_sigmas"),
    ],
)
def test_a_parameter_sets_its_limits_and_no_other(name: str, value: float, places: str) -> None:
    before, after = (
        flat(limits_of(params)) for params in (RegistrarParams(), replace(RegistrarParams(), **{name: value}))
    )
    assert {place for place in after if after[place] != before[place]} == set(places.split())
    assert all(after[place] == value for place in places.split())


def test_the_largest_perturbation_is_the_last() -> None:
    assert limits_of(replace(RegistrarParams(), pushes=(0.1, 0.3))).observability.perturbation_m == 0.3


def flat(limits: object, prefix: str = "") -> dict[str, float]:
    """Every number by its dotted name."""
    found: dict[str, float] = {}
    for name, value in limits._asdict().items():
        found |= flat(value, f"{prefix}{name}.") if hasattr(value, "_asdict") else {f"{prefix}{name}": value}
    return found
