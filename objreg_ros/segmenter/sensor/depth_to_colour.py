# SPDX-License-Identifier: Apache-2.0
"""The rotation that brings depth upon colour: where depth steps, colour has an edge.

Depth that was exposed before or after colour, or whose camera is not quite where its calibration says, is beside the
colour by some pixels. A camera that turns by 100 degrees a second turns by 2.5 degrees in a lag of 25 ms. Both are a
small rotation between the two cameras. It is the one that puts depth steps on the strongest gradients of grey:
the alignment of depth and colour edges (Levinson and Thrun, "Automatic online calibration of cameras and lasers",
2013), here for one frame by itself, with the result of earlier frames as its prior. It is measured in every frame of a
stream whose frames differ, as those of a camera that turns fast, and a few times a second in others.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.limits import MOST_DEPTH
from objreg_ros.native import kernels
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

_KERNELS = kernels("depth_to_colour")
WIDTH = 320  # px: the picture is halved until it is no wider
POINTS = 1500  # most depth steps that are asked
LEAST_POINTS = 400  # fewer give no result
LEAST_STRENGTH = 0.2  # of the gradients at the steps, in deviations, for these to be edges; real ones have 0.3 to 1
STEP = (3.0 * PLANE_TOLERANCE_M, 3.0 * PLANE_TOLERANCE_GROWTH)  # m and 1/m: depths that differ by more are a step
BLURS = (3.0, 1.5, 0.8)  # px of the reduced picture, coarse to fine
COARSE = (np.linspace(-0.05, 0.05, 9), np.linspace(-0.04, 0.04, 5))  # rad: about x and y, about z
STEPS = ((0.012, 0.006), (0.006, 0.003), (0.002, 0.001))  # rad, of each blur
ROUNDS = 6  # most of a step
BACKGROUND = 10.0  # px of the reduced picture: gradients are measured by the mean about them
FIRST_SIGMA = 0.003  # rad: the first guess of the spread; small, as a lone frame with few objects is misleading
NOISE = np.array([0.0012, 0.0008, 0.0025])  # rad: standard deviation of a frame's rotation, as in simulation
INDEPENDENT = 0.1  # share of the depth steps that are independent: neighbours agree
MOST_INDEPENDENT = 150.0  # independent steps of a frame, at most
SURPRISE = 3.0  # deviations: a larger difference is clipped to this
MEMORY = 20  # frames that are remembered
FIRST_FRAMES = 0.2  # the weight of the first guess of the spread, in frames
MATCHED = 1.5  # noise of depth in a Kinect's: simulated and real Kinects have 0.9 to 1.4, a RealSense D435 1.8 and more
DIFFER = 0.004  # rad, two pixels of the usual camera: where frames spread by more, each is measured
EVERY_S = 0.2  # else the offset of a frame is that of one so long before: it changes by half a pixel, as it errs
SMALLEST = 1e-3  # rad: half a pixel of the usual camera; less is left as it is


class DepthOffset(NamedTuple):
    """How depth is turned against colour in a frame, ``rotation (3,)`` rad; ``shown`` if the frame itself shows it."""

    rotation: Array
    shown: bool


@dataclass(slots=True, eq=False)
class DepthToColour:
    """The offset of one stream; remembers the offsets of its frames, until another camera comes.

    ``mean (3,)`` and ``spread (3,)`` rad are of the measured offsets, in so many ``frames``. ``found (3,)`` rad
    is that of the last frame by itself, None where it has none or was not measured.
    """

    mean: Array = field(default_factory=lambda: np.zeros(3))
    spread: Array = field(default_factory=lambda: np.full(3, FIRST_SIGMA))
    frames: int = 0
    found: Array | None = None
    _camera: tuple[Any, ...] | None = None
    _measured: int = 0  # frames
    _stamp_ns: int = 0  # of the last of them
    _rotation: Array = field(default_factory=lambda: np.zeros(3))  # of it

    def text(self) -> str:
        """How depth is turned against colour, as text; empty where no frame showed it."""
        if self.frames == 0:
            return ""
        mean, spread = (
            " ".join(f"{degrees:.2f}" for degrees in np.degrees(value)) for value in (self.mean, self.spread)
        )
        return f"{mean} deg about x y z, {spread} from frame to frame"

    def forget_stream(self) -> None:
        """Begin with another stream."""
        self.mean, self.spread, self.frames = np.zeros(3), np.full(3, FIRST_SIGMA), 0
        self.found, self._measured = None, 0

    def register(self, image: DepthImage, noise: float) -> DepthImage:
        """The image with its depth brought upon its colour; itself where it has no colour or nothing is to be done.

        Depth of a stereo camera is left as it is: its steps are half a matching window beside the objects. It is known
        by its ``noise``, in a Kinect's, which no other camera has.
        """
        self.found = None
        if image.rgb is None or noise > MATCHED:
            return image
        if self._is_due(image):
            self._rotation, self._stamp_ns = self.offset(image).rotation, image.stamp_ns
            self._measured += 1
        return image if np.abs(self._rotation).max() < SMALLEST else turned(image, self._rotation)

    def _is_due(self, image: DepthImage) -> bool:
        """Whether the offset of a frame is measured: of a stream that is new, or whose frames differ, that of each."""
        if self._camera != _identity(image) or self._measured < MEMORY or self.spread.max() > DIFFER:
            return True
        return not 0.0 <= 1e-9 * (image.stamp_ns - self._stamp_ns) < EVERY_S

    def offset(self, image: DepthImage) -> DepthOffset:
        """The offset of a frame, by its edges and by the frames before; those alone where it has few edges."""
        camera = _identity(image)
        if self._camera not in (None, camera):
            self.forget_stream()
        self._camera = camera
        self.found = found = find_rotation(image, self.mean, self.spread)
        if found is None:
            return DepthOffset(self.mean.copy(), False)
        self._remember(found)
        share = (
            1.0 - NOISE**2 / self.spread**2
        )  # of the measured offset that is no noise: frames that agree differ by it alone
        return DepthOffset(self.mean + share * (found - self.mean), True)

    def _remember(self, rotation: Array) -> None:
        """Take a frame in: exponential means of the offset and of its square, the first guess weighs `FIRST_FRAMES`."""
        self.frames += 1
        known = FIRST_FRAMES + min(self.frames - 1, MEMORY)
        away = np.clip(rotation - self.mean, -SURPRISE * self.spread, SURPRISE * self.spread)
        self.mean = self.mean + away / (1.0 + min(self.frames - 1, MEMORY))
        self.spread = np.maximum(np.sqrt((known * self.spread**2 + away**2) / (known + 1.0)), NOISE)


def find_rotation(image: DepthImage, mean: Array, spread: Array) -> Array | None:
    """The rotation (3,) rad of the depth camera against the colour camera, most likely under a prior.

    A depth step p is seen in colour where ``p + rotation x p`` is. None where too few steps are seen, or where they lie
    upon no edges under any rotation.
    """
    assert image.rgb is not None
    every = max(1, image.depth.shape[1] // WIDTH)
    depth, camera = np.ascontiguousarray(image.depth[::every, ::every]), _reduced(image.intrinsics, every)
    rays = _KERNELS.steps(depth, *camera, *STEP)
    if len(rays) < LEAST_POINTS:
        return None
    independent = min(INDEPENDENT * len(rays), MOST_INDEPENDENT)
    rays = np.ascontiguousarray(rays[:: len(rays) // POINTS + 1])
    grey = cv2.cvtColor(_shrunk(image.rgb, every), cv2.COLOR_RGB2GRAY).astype(np.float32)
    weight = 1.0 / (np.sqrt(independent) * spread)  # of the prior, in units of the score
    camera, rotation, strength = _halfway(camera, every), np.array(mean, float), _strength(grey)
    for k, blur in enumerate(BLURS):
        picture = cv2.GaussianBlur(strength, (0, 0), blur)
        if k == 0:
            rotation = _KERNELS.coarse(np.ascontiguousarray(rays[::3]), picture, camera, mean, weight, *COARSE)
        rotation = _KERNELS.climbed(rays, picture, camera, mean, weight, rotation, np.array(STEPS[k]), ROUNDS)
        if k == 0 and _KERNELS.score(rays, picture, camera, mean, np.zeros(3), rotation) < LEAST_STRENGTH:
            return None  # the steps lie upon no edges
    return rotation


def turned(image: DepthImage, rotation: Array) -> DepthImage:
    """The image with its depth as the colour camera would see it, ``rotation (3,)`` rad away from the depth camera."""
    camera = _reduced(image.intrinsics, 1)
    depth = _KERNELS.turned(image.depth, camera, np.asarray(rotation, np.float64), MOST_DEPTH)
    return replace(image, depth=depth)


def _identity(image: DepthImage) -> tuple[Any, ...]:
    """What is another camera where it differs."""
    return image.frame_id, image.depth.shape, _reduced(image.intrinsics, 1)


def _reduced(camera: Intrinsics, every: int) -> tuple[float, float, float, float]:
    return camera.fx / every, camera.fy / every, camera.cx / every, camera.cy / every


def _halfway(camera: tuple[float, float, float, float], every: int) -> tuple[float, float, float, float]:
    """The camera of a picture of which each pixel is the mean of ``every`` by ``every``: their middle is its place."""
    fx, fy, cx, cy = camera
    return fx, fy, cx - 0.5 * (every - 1) / every, cy - 0.5 * (every - 1) / every


def _shrunk(rgb: Array, every: int) -> Array:
    return np.asarray(cv2.resize(rgb, None, fx=1.0 / every, fy=1.0 / every, interpolation=cv2.INTER_AREA))


def _strength(grey: Array) -> Array:
    """How strong the gradient of grey is, by what is usual about it: (h, w) float32 of mean 0 and deviation 1."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    strength = np.sqrt(cv2.magnitude(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)))
    strength -= cv2.GaussianBlur(strength, (0, 0), BACKGROUND)
    return np.asarray(strength / max(float(strength.std()), 1e-6))
