# SPDX-License-Identifier: Apache-2.0
"""Gravity: both views know the direction down, more or less surely, and the pose must map one to the other."""

from __future__ import annotations

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate.refusal import Refusal

SIGMAS = 3.5  # deviations of both gravities together: one right pose of 450 is farther off


def check(error_deg: float | None, error_sigmas: float, most_sigmas: float) -> Refusal | None:
    """Refuse a pose whose two gravities are more than ``most_sigmas`` standard deviations apart.

    ``error_deg`` is None where one of them is unknown; then a camera counts as held upright, within wide limits.
    """
    if error_sigmas <= most_sigmas:
        return None
    angle = "upside down" if error_deg is None else f"{error_deg:.1f} deg"
    return Reason.GRAVITY, f"{angle}, {error_sigmas:.1f} standard deviations > {most_sigmas:.1f}"
