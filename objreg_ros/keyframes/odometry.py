# SPDX-License-Identifier: Apache-2.0
"""What odometry says of two keyframes of one session, and how far it may be wrong by then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, rotation_angle

TURNS_DEG_S = 360.0  # nothing turns faster for long


@dataclass(slots=True, eq=False)
class TravelledPath:
    """The camera's path through a session, from ``T_session_camera`` on: how far it has gone and turned until now."""

    T_session_camera: Array
    travelled: float = 0.0
    turned: float = 0.0

    def go(self, T_session_camera: Array) -> None:
        """Go on to another pose, straight."""
        metres, degrees = self._to(T_session_camera)
        self.travelled += metres
        self.turned += degrees
        self.T_session_camera = T_session_camera

    def is_near(self, T_session_camera: Array, metres: float, degrees: float) -> bool:
        """Whether another pose is no farther away than that."""
        moved, turned = self._to(T_session_camera)
        return moved <= metres and turned <= degrees

    def lose(self, seconds: float, max_speed: float) -> None:
        """Nothing was seen for so long: it may have gone as far as it gets, odometry may have begun anew meanwhile."""
        self.travelled += max_speed * seconds
        self.turned += TURNS_DEG_S * seconds

    def _to(self, T_session_camera: Array) -> tuple[float, float]:
        """Metres and degrees to another pose."""
        motion = inverse(self.T_session_camera) @ T_session_camera
        return float(np.linalg.norm(motion[:3, 3])), float(np.degrees(rotation_angle(motion[:3, :3])))
