# SPDX-License-Identifier: Apache-2.0
"""Convergence."""

from __future__ import annotations

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate import convergence


def test_a_refinement_that_did_not_converge_is_refused_with_the_points_that_found_a_partner() -> None:
    assert convergence.check(True, 0) is None
    assert convergence.check(False, 12) == (Reason.NOT_CONVERGED, "12 points find a partner")
