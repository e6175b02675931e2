# SPDX-License-Identifier: Apache-2.0
"""Odometry as a prior, and the largest plausible motion where there is none."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason
from objreg_ros.geometry import pose_error
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.propose.prior import Prior

FAR_M = 5.0  # between two cameras of one place, at most
SIGMAS = 4.0  # largest distance from odometry in its standard deviations
CM = 100.0  # in a metre


def check_plausible(T_target_source: Array, most_m: float) -> Refusal | None:
    """Refuse a pose (4, 4) whose cameras are more than ``most_m`` apart: two views of one place are nearer."""
    distance = float(np.linalg.norm(T_target_source[:3, 3]))
    if distance <= most_m:
        return None
    return Reason.IMPLAUSIBLE_MOTION, f"{distance:.2f} m > {most_m:.2f} m"


def check(T_target_source: Array, prior: Prior | None, sigmas: float) -> Refusal | None:
    """Refuse a pose (4, 4) that is more than ``sigmas`` deviations from the prior.

    A pose without a prior passes, and so does one whose prior is not trusted.
    """
    if prior is None or not prior.trusted:
        return None
    rotation_deg, translation_cm = pose_error(T_target_source, prior.T_target_source)
    most_deg, most_cm = sigmas * prior.rotation_deg, sigmas * CM * prior.translation_m
    if rotation_deg <= most_deg and translation_cm <= most_cm:
        return None
    return Reason.ODOMETRY, (
        f"{rotation_deg:.1f} deg {translation_cm:.0f} cm from odometry, "
        f"expected {most_deg:.1f} deg {most_cm:.0f} cm at most"
    )
