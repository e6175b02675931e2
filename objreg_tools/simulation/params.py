# SPDX-License-Identifier: Apache-2.0
"""The parameters of the simulated camera, of the stress put on it, and of the odometry."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class DepthParams(Params):
    """A depth sensor by structured light. The defaults are those of a Kinect for Xbox 360."""

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
class StereoParams(Params):
    """A depth sensor by active stereo. The defaults are those of a RealSense D435; pixels are those of its imagers."""

    subpixel: float = param(0.08, "standard deviation of disparity", "px", ge=0.0, le=2.0)
    focal: float = param(424.0, "focal length of the imagers (848 x 480)", "px", ge=50.0, le=5000.0)
    baseline: float = param(0.05, "distance of the second imager, to the right of the first", "m", ge=0.001, le=1.0)
    disparity_step: float = param(0.03125, "step of disparity; 0 has no steps", "px", ge=0.0, le=2.0)
    window: float = param(7.0, "side of the window that is matched", "px", ge=1.0, le=31.0)
    projector: float = param(
        0.1, "contrast that the projector's dots give to white at 1 m, share of white; falls with distance squared",
        ge=0.0, le=2.0,
    )  # fmt: skip
    least_contrast: float = param(0.004, "contrast below which half of the windows match nothing", ge=1e-5, le=1.0)
    contrast_scatter: float = param(
        0.6, "deviation of the logarithm of that limit from place to place", ge=0.01, le=5.0
    )
    near: float = param(0.28, "nearest depth that is measured", "m", ge=0.0)
    far: float = param(6.0, "farthest depth that is measured", "m", ge=0.1)
    dropout: float = param(0.002, "share of pixels lost anywhere", ge=0.0, le=1.0)
    grazing_cosine: float = param(0.2, "cosine of the viewing angle below which pixels are lost", ge=0.0, le=1.0)
    edge_jitter: float = param(1.0, "standard deviation of the place of depth edges", "px", ge=0.0, le=8.0)


@dataclass(frozen=True)
class TimeOfFlightParams(Params):
    """A depth sensor by time of flight. The defaults are those of an Azure Kinect."""

    noise: float = param(
        0.0005, "standard deviation of depth at 1 m from white; grows with distance and with 1/sqrt(reflectance)", "m",
        ge=0.0, le=0.1,
    )  # fmt: skip
    least_signal: float = param(
        0.008, "reflectance that is just measured at 1 m; falls with distance squared", ge=0.0, le=1.0
    )
    signal_scatter: float = param(0.3, "deviation of the logarithm of that limit", ge=0.01, le=5.0)
    flying: float = param(0.6, "share of pixels at depth edges that lie between both sides", ge=0.0, le=1.0)
    edge_dropout: float = param(0.25, "share of pixels lost at depth edges", ge=0.0, le=1.0)
    multipath: float = param(0.02, "most that light over another wall adds to depth in a corner", "m", ge=0.0, le=0.5)
    near: float = param(0.5, "nearest depth that is measured", "m", ge=0.0)
    far: float = param(5.46, "farthest depth that is measured", "m", ge=0.1)
    dropout: float = param(0.0005, "share of pixels lost anywhere", ge=0.0, le=1.0)


DepthSensing = DepthParams | StereoParams | TimeOfFlightParams


@dataclass(frozen=True)
class RigParams(Params):
    """How the two cameras are built and timed; all zero by default. The seed draws the direction of an error."""

    distortion: tuple[float, ...] = param(
        (0.0, 0.0, 0.0, 0.0, 0.0), "k1, k2, p1, p2, k3 of the lens (plumb_bob)", counts=(4, 5)
    )
    lag_ms: float = param(
        0.0, "the depth image shows the pose of so much earlier (negative: later); its stamp is that of the colour",
        "ms", ge=-500.0, le=500.0,
    )  # fmt: skip
    rolling_ms: float = param(0.0, "from the first row of colour to the last", "ms", ge=0, le=100)
    blur_ms: float = param(0.0, "exposure of colour, over which motion blurs it", "ms", ge=0, le=100)
    misregistration_px: float = param(0.0, "shift of depth against colour", "px", ge=0.0, le=50.0)
    misregistration_deg: float = param(0.0, "rotation of depth against colour, about any axis", "deg", ge=0.0, le=10.0)
    misregistration_mm: float = param(0.0, "error of the baseline from colour to depth", "mm", ge=0.0, le=100.0)

    @property
    def is_plain(self) -> bool:
        """Whether nothing is wrong: a pinhole camera whose pictures are both of one time and one place."""
        return not any(self.distortion) and self.replaced(distortion=(0.0,) * 5) == RigParams()


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
    """How odometry drifts; the model stands in `objreg_tools.simulation.odometry`."""

    distance_drift: float = param(0.02, "error of position after one metre, share of it", ge=0.0, le=1.0)
    turn_drift: float = param(1.0, "error of heading after one metre", "deg/m", ge=0.0, le=90.0)
    tilt_error: float = param(
        0.3, "error of roll and pitch; it does not grow, gravity is observed", "deg", ge=0.0, le=45.0
    )
    turn_jitter: float = param(0.0, "rotation by which each pose errs for itself, rms", "deg", ge=0.0, le=45.0)
    distance_jitter: float = param(0.0, "distance by which each pose errs for itself, rms", "m", ge=0.0, le=1.0)
