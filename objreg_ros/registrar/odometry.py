# SPDX-License-Identifier: Apache-2.0
"""What odometry says of two keyframes of one session, and how far it may be wrong by then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.params import RegistrarParams

TURNS_DEG_S = 360.0  # nothing turns faster for long


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prior:
    """``T_target_source`` as odometry expects it, with standard deviations that grow with the path in between.

    ``trusted`` is False where the pose comes from our own tracking, which may have slipped unnoticed: then it may
    propose, but nothing is refused because of it.
    """

    T_target_source: Array
    rotation_deg: float
    translation_m: float
    trusted: bool

    def tight(self, params: RegistrarParams) -> bool:
        """Whether a registration may start from it."""
        return self.translation_m <= params.prior_translation and self.rotation_deg <= params.prior_rotation


@dataclass(slots=True, eq=False)
class Way:
    """The camera's way through a session, from ``T_session_camera`` on: how far it has gone and turned until now."""

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


def expect(source: Keyframe, target: Keyframe, params: RegistrarParams) -> Prior | None:
    """What is expected between two keyframes: the less certain, the longer the way between them was.

    None where the two are of different sessions.
    """
    if source.session != target.session or source.T_odom_camera is None or target.T_odom_camera is None:
        return None
    way, turn = abs(source.travelled - target.travelled), abs(source.turned - target.turned)
    return Prior(
        T_target_source=inverse(target.T_odom_camera) @ source.T_odom_camera,
        rotation_deg=params.odometry_rotation_noise + params.odometry_rotation_drift * turn,
        translation_m=params.odometry_translation_noise + params.odometry_drift * way,
        trusted=source.by_odometry and target.by_odometry,
    )
