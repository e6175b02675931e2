# SPDX-License-Identifier: Apache-2.0
"""Gravity: both views know which way is down, and the pose must map one direction to the other."""

from __future__ import annotations

from objreg_ros.data import Reason
from objreg_ros.registration.gate.refusal import Refusal


def check(error_deg: float | None, most_deg: float) -> Refusal | None:
    """Refuse a pose whose two gravities are more than ``most_deg`` apart. None, where one is unknown, passes."""
    if error_deg is None or error_deg <= most_deg:
        return None
    return Reason.GRAVITY, f"{error_deg:.1f} deg > {most_deg:.1f} deg"
