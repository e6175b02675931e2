# SPDX-License-Identifier: Apache-2.0
"""What odometry expects of two keyframes of one session, and how far it may be wrong by then."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams

TIGHT_TRANSLATION_M = 0.2  # odometry whose position is less certain proposes no pose: it would start in another basin
TIGHT_ROTATION_DEG = 6.0  # odometry whose rotation is less certain proposes no pose


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

    def tight(self) -> bool:
        """Whether a registration may start from it."""
        return self.translation_m <= TIGHT_TRANSLATION_M and self.rotation_deg <= TIGHT_ROTATION_DEG


def expect(source: Keyframe, target: Keyframe, params: RegistrationParams) -> Prior | None:
    """What is expected between two keyframes: the less certain, the longer the path between them was.

    None where the two are of different sessions.
    """
    if source.session != target.session or source.T_odom_camera is None or target.T_odom_camera is None:
        return None
    path, turn = abs(source.travelled - target.travelled), abs(source.turned - target.turned)
    return Prior(
        T_target_source=inverse(target.T_odom_camera) @ source.T_odom_camera,
        rotation_deg=params.odometry_rotation_noise + params.odometry_rotation_drift * turn,
        translation_m=params.odometry_translation_noise + params.odometry_drift * path,
        trusted=source.by_odometry and target.by_odometry,
    )
