# SPDX-License-Identifier: Apache-2.0
"""The direction of gravity from all frames of a session together.

A single view takes it from the surfaces that it sees, and depth is warped: two views of one room differ by a degree,
some by four. But gravity is one, and odometry carries the estimates of earlier views to where the camera is now.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.keyframes.odometry import TravelledPath
from objreg_ros.sensor import ONE_VIEW

AT_REST_M, AT_REST_DEG = 0.01, 0.5  # what odometry may jitter by while the camera rests
DOUBT = 3  # power of a view's own confidence (`sensor.session_gravity_sigma_deg` knows it)


@dataclass(slots=True, eq=False)
class GravityFilter:
    """The mean of gravity over a session, forgotten over ``metres`` and ``degrees`` of motion.

    Views are weighed by the motion between them: what one view errs by the next one errs by too, and a camera that
    rests learns nothing. Odometry may tilt, so it is not carried for ever.
    """

    metres: float
    degrees: float
    _gravity_sum: Array = field(default_factory=lambda: np.zeros(3))  # in the session's frame, times its weight
    _path: TravelledPath | None = None

    def update(self, T_session_camera: Array, gravity: Array | None, confidence: float) -> tuple[Array | None, float]:
        """Go to a pose and take in the gravity of its view, None where it has none.

        Returns gravity (3,) of length 1 in the camera frame and its weight 0..1; (None, 0.0) where no view gave it yet.
        """
        kept = self._go(T_session_camera)
        seen = np.zeros(3) if gravity is None else confidence**DOUBT * (T_session_camera[:3, :3] @ gravity)
        self._gravity_sum = kept * self._gravity_sum + (1.0 - kept) * seen
        falls = self._gravity_sum + ONE_VIEW * seen
        weight = float(np.linalg.norm(falls))
        if weight < 1e-6:
            return None, 0.0
        return T_session_camera[:3, :3].T @ falls / weight, min(1.0, weight)

    def reset(self) -> None:
        """Begin again: nothing carries over to where the camera is now."""
        self._gravity_sum, self._path = np.zeros(3), None

    def _go(self, T_session_camera: Array) -> float:
        """The share of the sum that is kept after going on to a pose; all of it where that is as good as at rest."""
        path = self._path = self._path or TravelledPath(T_session_camera)
        if path.is_near(T_session_camera, AT_REST_M, AT_REST_DEG):
            return 1.0
        travelled, turned = path.travelled, path.turned
        path.go(T_session_camera)
        return float(np.exp((travelled - path.travelled) / self.metres + (turned - path.turned) / self.degrees))
