# SPDX-License-Identifier: Apache-2.0
"""Gravity: how far two views may differ about it."""

from __future__ import annotations

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate import gravity
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate


def test_a_refusal_says_the_angle_and_how_unlikely_it_is() -> None:
    assert gravity.check(3.5, 3.5, 3.5) is None
    assert gravity.check(7.2, 3.6, 3.5) == (Reason.GRAVITY, "7.2 deg, 3.6 standard deviations > 3.5")
    assert gravity.check(None, 5.0, 3.5) == (Reason.GRAVITY, "upside down, 5.0 standard deviations > 3.5")


@pytest.mark.parametrize("degrees", [1.0, 9.0])
def test_what_counts_is_how_sure_both_views_are(degrees: float) -> None:
    kept = candidate(gravity_error_deg=degrees, gravity_error_sigmas=gravity.SIGMAS - 0.1)
    lost = candidate(gravity_error_deg=degrees, gravity_error_sigmas=gravity.SIGMAS + 0.1)
    refusal = refuse(lost)
    assert refuse(kept) is None and refusal is not None and refusal[0] is Reason.GRAVITY
