# SPDX-License-Identifier: Apache-2.0
"""What a stream shows of its own sensor: the noise of depth, how depth lies upon colour, and how late it is.

Depth that shows the scene of ``lag`` seconds before colour is turned against it by ``-lag`` times the angular velocity
of the camera, beside what its calibration is wrong by. So the slope of the one over the other is the lag (Furgale,
Rehder and Siegwart, "Unified temporal and spatial calibration for multi-sensor systems", 2013, estimate an offset in
time like it). The angular velocity is that by which the picture moves from frame to frame, by phase correlation. It
gives two axes, and what the camera's translation adds to them moves depth on colour as well.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.sensor.depth_to_colour import DepthToColour
from objreg_ros.sensor import measured_noise, thinned

NOISE_EVERY = 10  # frames: so it costs a tenth of a millisecond of each
NOISES = 100  # that are remembered
PICTURE_WIDTH = 160  # px: the picture is reduced to this width or more, to measure its motion
LEAST_RESPONSE = 0.1  # of a phase correlation, for the picture to have moved as a whole
MOST_SHIFT = 0.05  # of the picture: as it rolls or moves by more, its shift says too little of the offset at that time
LONGEST_S = 0.25  # between two frames for a velocity; a hand that carries a camera turns back in half a second
TURNS = 1000  # that are remembered
LEAST_TURNS, LEAST_CLUSTERS = 30, 5  # for a lag to be reported
LEAST_VELOCITY = 0.1  # rad/s, its deviation: below, a lag of 10 ms is lost in what an offset errs by
CLUSTER_S = 1.0  # frames within this time have similar errors
OUTLIER = 3.0  # deviations, from the median of all: what differs by more counts in none of the rounds after
ROUNDS = 5
FLOOR_MS = 3.0  # the error of lags of simulated streams beyond their scatter
MOST_SIGMA_MS = 10.0  # a lag that is known less well is not reported


class Lag(NamedTuple):
    """How late depth is behind colour, and its standard deviation, in ms; negative where colour is late."""

    ms: float
    sigma_ms: float

    def text(self) -> str:
        """The lag as text."""
        return f"{self.ms:.0f} +- {self.sigma_ms:.0f} ms"


class TurnSample(NamedTuple):
    """By what depth is turned against colour, ``offset (2,)`` rad about x and y, as the camera turns by
    ``velocity (2,)`` rad/s; ``seconds`` of the stream's clock."""

    seconds: float
    velocity: Array
    offset: Array


class _Picture:
    """A picture, reduced once it is asked for."""

    def __init__(self, image: DepthImage) -> None:
        assert image.rgb is not None
        height, width = image.rgb.shape[:2]
        self._rgb, self.stamp_ns = image.rgb, image.stamp_ns
        self._every = max(1, min(width // PICTURE_WIDTH, height))  # a strip keeps a row
        self.focal = np.array([image.intrinsics.fx, image.intrinsics.fy]) / self._every
        self._motion: dict[int, Array | None] = {}

    @cached_property
    def grey(self) -> Array:
        """(h, w) float32."""
        scale = 1.0 / self._every
        small = cv2.resize(self._rgb, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        return cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float32)

    def velocity_from(self, last: _Picture) -> Array | None:
        """The angular velocity (2,) rad/s by which the ``last`` picture became this one; None where it is not known."""
        if last.stamp_ns not in self._motion:
            self._motion[last.stamp_ns] = self._measured_from(last)
        return self._motion[last.stamp_ns]

    def _measured_from(self, last: _Picture) -> Array | None:
        seconds = 1e-9 * (self.stamp_ns - last.stamp_ns)
        if not 0.0 < seconds <= LONGEST_S or last.grey.shape != self.grey.shape or min(self.grey.shape) == 1:
            return None  # one row shows no motion
        shift, response = cv2.phaseCorrelate(last.grey, self.grey, _window(self.grey.shape))
        if response < LEAST_RESPONSE or max(np.abs(shift)) > MOST_SHIFT * self.grey.shape[1]:
            return None
        right, down = np.array(shift) / (self.focal * seconds)
        return np.array([down, -right])


@lru_cache(maxsize=2)
def _window(hw: tuple[int, int]) -> Array:
    return np.asarray(cv2.createHanningWindow(hw[::-1], cv2.CV_32F))


@dataclass(slots=True, eq=False)
class PictureMotion:
    """How fast a picture moves about each frame: the mean of before and after, so it is known one frame later."""

    _seen: deque[_Picture] = field(default_factory=lambda: deque(maxlen=3))

    def forget_stream(self) -> None:
        """Begin with another stream."""
        self._seen.clear()

    def see(self, image: DepthImage) -> None:
        """Take the next picture; nothing is measured before `velocity` is asked for."""
        self._seen.append(_Picture(image))

    def velocity(self) -> Array | None:
        """The angular velocity (2,) rad/s about x and y at the frame before the last; None where it is not known."""
        if len(self._seen) < 3:
            return None
        first, middle, last = self._seen
        before, after = middle.velocity_from(first), last.velocity_from(middle)
        return None if before is None or after is None else 0.5 * (before + after)


@dataclass(slots=True, eq=False)
class SensorEstimate:
    """The noise, the offset and the lag of one stream's depth."""

    depth_to_colour: DepthToColour = field(default_factory=DepthToColour)
    _motion: PictureMotion = field(default_factory=PictureMotion)
    _turns: deque[TurnSample] = field(default_factory=lambda: deque(maxlen=TURNS))
    noise: float | None = None  # of depth in that of a Kinect v1, the median of the last frames with one
    _noises: deque[float] = field(default_factory=lambda: deque(maxlen=NOISES))
    _seen: int = 0
    _camera: tuple[str, tuple[int, ...]] | None = None
    _waiting: tuple[float, Array] | None = None  # of the last frame: when it was, and its offset

    def forget_stream(self) -> None:
        """Begin with another stream."""
        self.depth_to_colour.forget_stream()
        self._forget_own()

    def _forget_own(self) -> None:
        self._motion.forget_stream()
        self._turns.clear()
        self._noises.clear()
        self.noise, self._seen, self._waiting = None, 0, None

    def register(self, image: DepthImage) -> DepthImage:
        """The image with its depth brought upon its colour, as `DepthToColour.register` does; measures both.

        Another camera begins anew.
        """
        camera = image.frame_id, image.depth.shape
        if self._camera not in (None, camera):
            self._forget_own()
        self._camera = camera
        if self._seen % NOISE_EVERY == 0:
            self._measure_noise(image)
        self._seen += 1
        registered = self.depth_to_colour.register(image, self.noise or 1.0)
        if image.rgb is not None:
            self._note_turn(image)
        return registered

    def _note_turn(self, image: DepthImage) -> None:
        """Put the offset of the frame before, if it was measured, beside its velocity, which is known with this one."""
        self._motion.see(image)
        velocity = None if self._waiting is None else self._motion.velocity()
        if velocity is not None and self._waiting is not None:
            self._turns.append(TurnSample(self._waiting[0], velocity, self._waiting[1]))
        found = self.depth_to_colour.found
        self._waiting = None if found is None else (1e-9 * image.stamp_ns, found[:2])

    def _measure_noise(self, image: DepthImage) -> None:
        noise = measured_noise(thinned(image.depth))
        if noise is not None:
            self._noises.append(noise)
            self.noise = float(np.median(self._noises))

    @property
    def lag(self) -> Lag | None:
        """How late depth is; None where it is not known within 10 ms, as of a camera that hardly turns."""
        found = fit_lag(list(self._turns.copy()))
        return None if found is None or found.sigma_ms > MOST_SIGMA_MS else found


def fit_lag(turns: list[TurnSample]) -> Lag | None:
    """The lag, by least squares of the offsets over the velocities with a constant for each axis.

    None of too few of them, and of a camera that hardly turns.

    The standard deviation is cluster-robust, as the edges of one second err alike, and has a floor.
    """
    if len(turns) < LEAST_TURNS:
        return None
    velocity, offset = np.array([t.velocity for t in turns]), np.array([t.offset for t in turns])
    cluster = np.floor(np.array([t.seconds for t in turns]) / CLUSTER_S).astype(np.int64)
    kept = np.ones(len(turns), np.bool_)
    for _ in range(ROUNDS):
        x, y = velocity - velocity[kept].mean(axis=0), offset - offset[kept].mean(axis=0)
        spread = float(np.sum(x[kept] ** 2))
        if spread < LEAST_VELOCITY**2 * np.count_nonzero(kept):
            return None
        slope = float(np.sum(x[kept] * y[kept])) / spread
        left = y - slope * x
        size = np.abs(left) / np.maximum(1.4826 * np.median(np.abs(left), axis=0), 1e-9)
        kept = (size <= OUTLIER).all(axis=1)
    names, which = np.unique(cluster[kept], return_inverse=True)
    if len(names) < LEAST_CLUSTERS:
        return None
    pulls = np.bincount(which, np.sum(x[kept] * left[kept], axis=1))
    variance = float(np.sum(pulls**2)) / spread**2 * len(names) / (len(names) - 1)
    return Lag(-1e3 * slope, float(np.hypot(1e3 * np.sqrt(variance), FLOOR_MS)))
