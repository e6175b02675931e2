# SPDX-License-Identifier: Apache-2.0
"""The source of gravity: odometry, an IMU, or the picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.sensor import gravity_confidence, gravity_sigma_deg

APART = 3.0  # deviations of both together: beyond, the picture took for level what is not


class GravityChoice(NamedTuple):
    """Up (3,) of length 1 in the camera frame or None, its confidence 0..1, its source, and the disagreement.

    ``source`` is ``imu``, ``picture``, ``odom`` or ``nothing``; ``disagreement_deg`` is the angle between the IMU's
    direction and the picture's, None where there are not both.
    """

    up: Array | None
    confidence: float
    source: str
    disagreement_deg: float | None = None


def choose_gravity(up: Array, sigma_deg: float, seen: Array | None, confidence: float) -> GravityChoice:
    """The surer one of the IMU's direction, ``up (3,)``, and the picture's, ``seen (3,)`` or None.

    Where they contradict each other, it is the IMU: no confidence of the picture distinguishes a slope from a floor.
    """
    felt = gravity_confidence(sigma_deg)
    if seen is None:
        return GravityChoice(up, felt, "imu") if felt > 0.0 else GravityChoice(None, 0.0, "nothing")
    cross = float(np.linalg.norm(np.cross(up, seen)))
    apart_deg = float(np.degrees(np.arctan2(cross, up @ seen)))
    seen_sigma_deg = gravity_sigma_deg(confidence)
    contradicts = apart_deg > APART * float(np.hypot(sigma_deg, seen_sigma_deg))
    if felt > 0.0 and (contradicts or sigma_deg <= seen_sigma_deg):
        return GravityChoice(up, felt, "imu", apart_deg)
    return GravityChoice(seen, confidence, "picture", apart_deg)
