# SPDX-License-Identifier: Apache-2.0
"""The frame at reduced size: every step-th pixel as a point, and the grey value around it."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.native import kernels

_KERNELS = kernels("view")
BETWEEN = np.array([-1.0, 9.0, 9.0, -1.0]) / 16.0  # of four pixels: what is between the two in the middle
LEAST_WIDTH = 160  # px: what a narrower view holds is too coarse to locate a pose


def step_for(camera: Intrinsics, most: int) -> int:
    """The step of the view of a camera's picture: ``most``, or what leaves `LEAST_WIDTH` columns.

    Of a huge picture a larger one, so that it leaves the pixels that the registrar works with.
    """
    return max(1, min(most, camera.width // LEAST_WIDTH), camera.step_within(limits.OWN_VIEW_PIXELS))


def reduced_view(image: DepthImage, step: int, z_min: float, z_max: float) -> View:
    """Every ``step``-th pixel from pixel ``step // 2`` on; points outside z_min … z_max metres are NaN.

    Colour becomes the mean grey (ITU-R BT.601) of step × step pixels about that one; without colour grey is None.
    Where the image is smaller than ``step`` pixels, every pixel is kept.
    """
    step = step if min(image.depth.shape) > step // 2 else 1
    camera = image.intrinsics.scaled(step)
    first = step // 2
    depth = np.ascontiguousarray(image.depth[first::step, first::step])
    x = ((np.arange(camera.width) - camera.cx) / camera.fx).astype(np.float32)
    y = ((np.arange(camera.height) - camera.cy) / camera.fy).astype(np.float32)
    xyz = _KERNELS.back_project(depth, x, y, max(z_min, limits.LEAST_RANGE), z_max)
    grey = None if image.rgb is None else _grey(image.rgb, step)
    return View(xyz=xyz, grey=grey, intrinsics=camera)


def _grey(rgb: Array, step: int) -> Array:
    """The mean grey of step × step pixels about every ``step``-th one.

    An even number has its middle half a pixel of the picture beside the one whose depth the grey goes with, and moves
    poses between opposite views by millimetres: it is brought on to there, by cubic convolution (Keys, 1981) since a
    linear one leaves fine prints behind.
    """
    share = np.full(step, 1.0 / step)
    if step % 2 == 0:
        share = np.convolve(share, BETWEEN)
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    first = slice(step // 2, None, step)
    return np.ascontiguousarray(cv2.sepFilter2D(grey, -1, share, share, borderType=cv2.BORDER_REPLICATE)[first, first])
