# SPDX-License-Identifier: Apache-2.0
"""Convergence: whether the refinement ended in a minimum."""

from __future__ import annotations

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate.refusal import Refusal


def check(converged: bool, inliers: int) -> Refusal | None:
    """Refuse a refinement that did not converge; ``inliers`` points found a partner."""
    return None if converged else (Reason.NOT_CONVERGED, f"{inliers} points find a partner")
