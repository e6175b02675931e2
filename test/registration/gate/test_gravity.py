# SPDX-License-Identifier: Apache-2.0
"""Gravity: how far two views may differ about it."""

from __future__ import annotations

from objreg_ros.data import Reason
from objreg_ros.registration.certainty.gravity_update import MOST_GRAVITY_ERROR_DEG
from objreg_ros.registration.gate import gravity
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate


def test_gravity_that_is_unknown_refuses_nothing() -> None:
    assert gravity.check(None, 3.5) is None and gravity.check(3.5, 3.5) is None
    assert gravity.check(3.6, 3.5) == (Reason.GRAVITY, "3.6 deg > 3.5 deg")


def test_gravity_may_tilt_by_what_the_planes_of_two_views_err_and_no_more() -> None:
    most = MOST_GRAVITY_ERROR_DEG
    assert most < 4.0
    assert refuse(candidate(gravity_error_deg=most - 0.1)) is None
    refusal = refuse(candidate(gravity_error_deg=most + 0.1))
    assert refusal is not None and refusal[0] is Reason.GRAVITY
