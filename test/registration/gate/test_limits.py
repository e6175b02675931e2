# SPDX-License-Identifier: Apache-2.0
"""The numbers of the gate, and which of them a user sets."""

from __future__ import annotations

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.gate import free_space, surroundings
from objreg_ros.registration.gate.limits import LIMITS, Limits, limits_of


def test_no_limit_changes_unnoticed() -> None:
    assert (
        Limits(
            odds=75.0,
            translation_m=5.0,
            gravity_sigmas=3.5,
            free_space=free_space.FreeSpaceLimits(violations=0.15, certain=0.03),
            surroundings=surroundings.SurroundingsLimits(tested=600, inliers=0.35, correlation_loss=0.25, score=0.25),
            score_margin=0.1,
            odometry_sigmas=4.0,
        )
        == LIMITS
    )


def test_a_user_who_sets_nothing_has_the_limits_as_they_are() -> None:
    assert limits_of(RegistrarParams()) == LIMITS


def test_a_user_sets_the_least_odds_and_the_largest_motion_and_nothing_else() -> None:
    chosen = limits_of(RegistrarParams(least_odds=500.0, max_translation=2.0))
    assert chosen == LIMITS._replace(odds=500.0, translation_m=2.0)
