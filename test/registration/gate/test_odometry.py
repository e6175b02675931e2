# SPDX-License-Identifier: Apache-2.0
"""Odometry as a prior, and plausible motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registration.gate import odometry
from objreg_ros.registration.gate.limits import LIMITS
from objreg_ros.registration.gate.verdict import refuse
from objreg_ros.registration.propose.prior import Prior
from registration.samples import candidate, moved


def test_a_motion_is_plausible_up_to_a_distance() -> None:
    assert odometry.check_plausible(moved(3.0, 4.0), 5.0) is None
    assert odometry.check_plausible(moved(3.0, 4.0), 4.9) == (Reason.IMPLAUSIBLE_MOTION, "5.00 m > 4.90 m")


def test_a_pose_without_a_prior_passes_and_one_beyond_it_is_refused_with_both_limits() -> None:
    assert odometry.check(moved(9.0), None, 4.0) is None
    refusal = odometry.check(moved(0.0), _prior(0.3), 4.0)
    assert refusal == (Reason.ODOMETRY, "0.0 deg 30 cm from odometry, expected 4.0 deg 20 cm at most")


def _prior(x: float, trusted: bool = True) -> Prior:
    return Prior(T_target_source=moved(x), rotation_deg=1.0, translation_m=0.05, trusted=trusted)


def test_a_pose_far_from_odometry_is_refused_unless_it_is_our_own_tracking() -> None:
    assert refuse(candidate(), _prior(0.05)) is None
    assert refuse(candidate(), _prior(1.0, trusted=False)) is None
    refusal = refuse(candidate(), _prior(1.0))
    assert refusal is not None and refusal[0] is Reason.ODOMETRY


@pytest.mark.parametrize(("beyond", "accepted"), [(0.9, True), (1.1, False)])
def test_odometry_refuses_a_turn_as_well_as_a_shift_beyond_its_sigmas(beyond: float, accepted: bool) -> None:
    sigmas = beyond * LIMITS.odometry_sigmas
    turned = pose(rotation_from_vector(np.radians([0.0, sigmas * 1.0, 0.0])), np.zeros(3))
    for prior in (_prior(sigmas * 0.05), replace(_prior(0.0), T_target_source=turned)):
        refusal = refuse(candidate(), prior)
        assert (refusal is None) is accepted and (accepted or refusal[0] is Reason.ODOMETRY)
