# SPDX-License-Identifier: Apache-2.0
"""What can be set of the simulated camera, of the stress put on it, and of the odometry."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class DepthParams(Params):
    """The depth sensor. The defaults are those of a Kinect for Xbox 360 (structured light)."""

    noise_floor: float = param(0.0012, "standard deviation of depth at 0.4 m", "m", ge=0.0, le=0.1)
    noise_growth: float = param(
        0.0019, "growth of the deviation of depth with the square of the distance beyond 0.4 m", "1/m", ge=0.0, le=0.1
    )
    quantum: float = param(0.00285, "step of depth at 1 m; grows with the square of distance", "m", ge=0.0, le=0.1)
    baseline: float = param(
        0.075, "distance of the projector, to the right of the camera; 0 throws no shadow", "m", ge=0
    )
    near: float = param(0.4, "nearest depth that is measured", "m", ge=0.0)
    far: float = param(5.0, "farthest depth that is measured", "m", ge=0.1)
    dropout: float = param(0.003, "share of pixels lost anywhere", ge=0.0, le=1.0)
    grazing_cosine: float = param(0.28, "cosine of the viewing angle below which pixels get lost", ge=0.0, le=1.0)
    edge_jitter: float = param(0.8, "standard deviation of the place of depth edges", "px", ge=0.0, le=8.0)
    edge_dropout: float = param(0.3, "share of pixels lost at depth edges", ge=0.0, le=1.0)
    mixed: float = param(0.15, "share of pixels at depth edges that lie between both sides", ge=0.0, le=1.0)


@dataclass(frozen=True)
class ColourParams(Params):
    """The colour camera."""

    brightness: float = param(0.45, "mean grey value that the exposure aims at, 0..1", ge=0.01, le=0.99)
    blur: float = param(0.7, "standard deviation of the lens and Bayer blur", "px", ge=0.0, le=10.0)
    shot_noise: float = param(
        0.012, "noise of a white pixel, share of white; grows with the root of light", ge=0.0, le=0.5
    )
    read_noise: float = param(0.006, "noise of a black pixel, share of white", ge=0.0, le=0.5)
    vignetting: float = param(0.12, "loss of light in the corners", ge=0.0, le=1.0)
    tint: tuple[float, ...] = param((1.0, 1.0, 1.0), "gain of red, green and blue: the white balance")


@dataclass(frozen=True)
class StressParams(Params):
    """What makes a recording harder than its sensor; all zero by default."""

    depth_bias: float = param(0.0, "depth is scaled by 1 plus this", ge=-0.2, le=0.2)
    warp: float = param(0.0, "low-frequency depth error at 1 m; grows with the square of distance", "m", ge=0.0, le=0.1)
    ragged: float = param(0.0, "added jitter of depth edges", "px", ge=0.0, le=8.0)
    occluders: int = param(0, "things added to every table, close to what stands there", ge=0, le=30)
    motion_blur: float = param(0.0, "length of the colour image's motion blur", "px", ge=0.0, le=64.0)


@dataclass(frozen=True)
class OdometryParams(Params):
    """How odometry drifts; the model stands in `objreg_ros.simulation.odometry`."""

    distance_drift: float = param(0.02, "error of position after one metre, share of it", ge=0.0, le=1.0)
    turn_drift: float = param(1.0, "error of heading after one metre", "deg/m", ge=0.0, le=90.0)
    tilt_error: float = param(
        0.3, "error of roll and pitch; it does not grow, gravity is observed", "deg", ge=0.0, le=45.0
    )
