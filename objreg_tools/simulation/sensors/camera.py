# SPDX-License-Identifier: Apache-2.0
"""Cameras, sensors and lenses by name, and what a colour sensor makes of light: exposure, blur, tone, noise."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.native import kernels
from objreg_tools.simulation.params import (
    ColourParams,
    DepthParams,
    DepthSensing,
    StereoParams,
    StressParams,
    TimeOfFlightParams,
)
from objreg_tools.simulation.rendering.shade import LIGHT_SCALE

_KERNELS = kernels("camera")
KINECT = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)
CAMERAS = {
    "kinect": KINECT,
    "realsense_d435": Intrinsics(fx=615.0, fy=615.0, cx=320.0, cy=240.0, width=640, height=480),
    "azure_kinect": Intrinsics(fx=504.0, fy=504.0, cx=319.5, cy=287.5, width=640, height=576),
    "qvga": Intrinsics(fx=262.5, fy=262.5, cx=159.5, cy=119.5, width=320, height=240),
}
SENSORS: dict[str, tuple[str, DepthSensing]] = {
    "kinect_v1": ("kinect", DepthParams()),
    "realsense_d435": ("realsense_d435", StereoParams()),
    "azure_kinect": ("azure_kinect", TimeOfFlightParams()),
}
"""Of each sensor the name of its camera, and how it measures depth."""
LENSES = {
    "kinect_v1": (0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
    "webcam": (-0.32, 0.11, 0.0005, -0.0004, 0.0),
}
"""k1, k2, p1, p2, k3 (plumb_bob) by name: the colour camera of TUM's freiburg1; a wide lens with a strong barrel."""


class ColourSensor:
    """The sensor for one image: exposes and blurs the whole, then develops any rows."""

    def __init__(self, params: ColourParams, stress: StressParams, seed: int) -> None:
        if len(params.tint) != 3 or min(params.tint) <= 0:
            raise ValueError(f"tint: expected three gains above 0, got {params.tint}")
        self.params, self.stress = params, stress
        rng = np.random.default_rng([seed, 13])
        self.seed = np.uint64(int(rng.integers(2**62)))
        self.direction = float(rng.uniform(0, np.pi))

    def exposed(self, light: Array) -> tuple[Array, Array]:
        """The light (H, W, 3) uint16 as the blurred image on the sensor, and the gain (3,) of each colour."""
        mean = float(light[::8, ::8].mean()) / LIGHT_SCALE
        gain = self.params.brightness / max(mean, 1e-3)
        gains = np.array(self.params.tint, np.float32) * np.float32(min(gain, 8.0) / LIGHT_SCALE)
        blurred = cv2.GaussianBlur(light, (0, 0), self.params.blur) if self.params.blur > 0.05 else light
        return self._smeared(blurred), gains

    def develop(self, raw: Array, gains: Array, rows: tuple[int, int], rgb: Array) -> None:
        """Turn ``rows`` of the exposed image into ``rgb (H, W, 3) uint8``."""
        p = self.params
        numbers = (np.float32(p.shot_noise), np.float32(p.read_noise), np.float32(p.vignetting))
        _KERNELS.develop(raw, *rows, gains, *numbers, self.seed, rgb)

    def _smeared(self, image: Array) -> Array:
        length = round(self.stress.motion_blur)
        if length < 2:
            return image
        kernel = np.zeros((length | 1, length | 1), np.float32)
        middle = length // 2
        reach = middle * np.array([np.cos(self.direction), np.sin(self.direction)])
        start, end = (tuple(round(middle + s * r) for r in reach) for s in (-1, 1))
        cv2.line(kernel, start, end, 1.0)
        return cv2.filter2D(image, -1, kernel / kernel.sum())
