# SPDX-License-Identifier: Apache-2.0
"""The parameters of keyframes, and of the keyframer's node."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import FramesParams, param
from objreg_ros.registration.params import ContextParams


@dataclass(frozen=True)
class KeyframeParams(ContextParams):
    """What becomes a keyframe; of the registrar, and of a keyframer that works for one elsewhere."""

    keyframe_translation: float = param(0.15, "motion that ends a keyframe", "m", ge=0.0, live=True)
    keyframe_rotation: float = param(8.0, "rotation that ends a keyframe", "deg", ge=0.0, le=180.0, live=True)
    keyframe_seconds: float = param(1.0, "longest time that a keyframe spans", "s", ge=0.0, live=True)
    max_speed: float = param(5.0, "odometry that leaps faster than this has begun anew: another session", "m/s", ge=0.1)


@dataclass(frozen=True)
class KeyframerNodeParams(FramesParams):
    """What a keyframer sends."""

    kilobytes: int = param(
        100,
        "most that a keyframe takes on the air; its objects are thinned where it would take more",
        "kB",
        ge=10,
        live=True,
    )
