# SPDX-License-Identifier: Apache-2.0
"""Active stereo: depth with the errors of a RealSense D435.

* The error of disparity is ``subpixel`` px, so that of depth is z^2 subpixel / (focal baseline): 3.8 mm at 1 m and
  34 mm at 3 m (Intel, "Best known methods for tuning RealSense D400 depth cameras", 2018, has the formula and 0.08 px).
  Matching takes the mean over a window, so the error is as alike as the windows of two pixels overlap.
* A window that has too little contrast matches nothing. Contrast is that of the picture in the window (clipped at
  white) and that of the projector's dots, which falls with the square of distance and with the grey of the surface.
* A window that reaches over an edge matches by the foreground: things grow by half a window ("foreground fattening",
  Scharstein and Szeliski, "A taxonomy and evaluation of dense two-frame stereo correspondence algorithms", 2002).
* What the second imager, to the right, does not see has no depth: a shadow to the left of things.

The imagers are taken to look where the colour camera does; the grey of the picture stands for that in the infrared.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtr

from objreg_ros.data.checked import Array
from objreg_tools.simulation.params import StereoParams, StressParams
from objreg_tools.simulation.rendering.shade import LIGHT_SCALE
from objreg_tools.simulation.rendering.view import RenderedView
from objreg_tools.simulation.sensors.fields import JUMP_SHARE, edges, shadows, smooth, wandered
from objreg_tools.simulation.sensors.noise import warp_field

IMAGERS_GREY = 0.45
"""Mean grey that the exposure of the imagers aims at, 0..1."""
MOST_GAIN = 8.0
WHITE = 0.98
"""Windows whose mean grey is more are saturated: dots do not show on them."""
BLOTCH_WINDOWS = 3
"""Holes are about as many windows wide."""


def match(view: RenderedView, loss: Array, p: StereoParams, stress: StressParams, seed: int) -> Array:
    """(H, W) float32: the depth in metres that the sensor measures, 0 where none.

    ``view`` has light (ValueError else). ``loss (F,)`` is the share of a face that has no depth.
    """
    shape, scale = view.nearness.shape, view.camera.fx / p.focal
    window = window_px(p, view.camera.fx)
    rng = np.random.default_rng([seed, 17])
    nearness = fattened(wandered(view.nearness, scale * p.edge_jitter + stress.ragged, rng), window)
    lost = shadows(nearness, view.camera.fx * p.baseline) | (nearness <= 0)
    blotches = smooth(rng, shape, BLOTCH_WINDOWS * window)
    lost |= np.log(contrast(view, p, window) / p.least_contrast) < p.contrast_scatter * blotches
    lost |= ndtr(smooth(rng, shape, BLOTCH_WINDOWS * window)) < view.of_faces(loss)
    lost |= (view.cosines() < p.grazing_cosine) | (rng.random(shape, np.float32) < p.dropout)
    disparity = p.focal * p.baseline * nearness + p.subpixel * smooth(rng, shape, window)
    if p.disparity_step > 0:
        disparity = np.rint(disparity / p.disparity_step) * p.disparity_step
    z = np.divide(p.focal * p.baseline, disparity, out=np.zeros_like(disparity), where=disparity > 0)
    z = z * (1 + stress.depth_bias) + warp_field(seed, shape, stress.warp) * z * z
    return np.where(lost | (z < p.near) | (z > p.far), 0, z).astype(np.float32)


def window_px(p: StereoParams, fx: float) -> int:
    """The side of the matched window in pixels of a picture of focal length ``fx``, odd."""
    return int(p.window * fx / p.focal) // 2 * 2 + 1


def contrast(view: RenderedView, p: StereoParams, window: int) -> Array:
    """(H, W) float32: the deviation of grey within the window at every pixel, share of white, dots included."""
    if view.light is None:
        raise ValueError("expected a view with light, by which stereo matches; got one without")
    light = view.light.mean(axis=2, dtype=np.float32) / np.float32(LIGHT_SCALE)
    grey = np.minimum(light * np.float32(min(IMAGERS_GREY / max(float(light.mean()), 1e-3), MOST_GAIN)), 1)
    size = (window, window)
    mean = cv2.blur(grey, size)
    printed = np.maximum(cv2.blur(grey.astype(float) ** 2, size) - cv2.blur(grey.astype(float), size) ** 2, 0)
    dots = np.where(mean < WHITE, p.projector * mean * view.nearness**2, 0)
    return np.asarray(np.maximum(np.sqrt(printed + dots**2), 1e-9), np.float32)


def fattened(nearness: Array, window: int) -> Array:
    """The nearness of things grown by half a window over what lies behind them."""
    grown = cv2.dilate(nearness, np.ones((window, window), np.uint8))
    behind = grown > nearness * np.float32(1 + JUMP_SHARE)
    return np.where(behind & edges(nearness, max(window // 2, 1)), grown, nearness)
