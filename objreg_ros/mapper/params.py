# SPDX-License-Identifier: Apache-2.0
"""The parameters of the mapper."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class MapperParams(Params):
    """Everything that a user may set in this room."""

    keyframe_translation: float = param(0.25, "motion after which odometry becomes a keyframe", "m", ge=0.01)
    keyframe_rotation: float = param(15.0, "rotation after which odometry becomes a keyframe", "deg", ge=0.1, le=180.0)

    # How odometry is believed: errors grow with the square root of the way, so a steady bias fits in over a long way.
    odometry_translation_error: float = param(
        0.05, "standard deviation of odometry after one metre or one radian", "m", ge=1e-4
    )
    odometry_rotation_error: float = param(
        2.0, "standard deviation of odometry after one metre or one radian", "deg", ge=1e-3
    )
    max_residual: float = param(
        5.0, "a constraint farther than this from all the others is pruned", "standard deviations", ge=1.0
    )
