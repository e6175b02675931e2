# SPDX-License-Identifier: Apache-2.0
"""The flags of an object as a whole: whether something cuts it, and whether it is a patch of a wall."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.native import kernels
from objreg_ros.segmenter.objects.extract import Pixels
from objreg_ros.segmenter.surface.cells import Surface, Window
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

_KERNELS = kernels("flags")
TOLERANCE = PLANE_TOLERANCE_M, PLANE_TOLERANCE_GROWTH
NEAR_BORDER = 0.012  # of the image's size
MIN_CELLS = 100


def whole_flags(image: DepthImage, pixels: Pixels, around: Surface, chosen: Array, box: Window) -> PointFlag:
    """The flags of an object of ``pixels``, that is ``chosen (h, w) bool`` of ``around``; ``box`` in cells of that."""
    flags = PointFlag(0)
    cut, wall_like = _KERNELS.inspect(around.depth, around.x, around.y, chosen, box, MIN_CELLS, TOLERANCE)
    if cut:
        flags |= PointFlag.CUT_BY_BOX
    if len(pixels) > 0 and (_touches_border(pixels, *image.depth.shape) or _touches_unseen(pixels, image)):
        flags |= PointFlag.CUT_BY_IMAGE
    if wall_like:
        flags |= PointFlag.WALL_LIKE
    return flags


def _touches_border(pixels: Pixels, height: int, width: int) -> bool:
    x0, y0, x1, y1 = pixels.bounds
    du, dv = max(1, round(NEAR_BORDER * width)), max(1, round(NEAR_BORDER * height))
    return x0 < du or y0 < dv or x1 > width - du or y1 > height - dv


def _touches_unseen(pixels: Pixels, image: DepthImage) -> bool:
    """Whether an object comes near to where a rectified picture shows nothing: the border of the raw one."""
    if image.shown is None:
        return False
    height, width = image.depth.shape
    x0, y0, x1, y1 = pixels.bounds
    du, dv = max(1, round(NEAR_BORDER * width)), max(1, round(NEAR_BORDER * height))
    left, top = max(0, x0 - du), max(0, y0 - dv)
    shown = image.shown[top : y1 + dv, left : x1 + du]
    if shown.all():
        return False
    near = cv2.dilate((~shown).astype(np.uint8), np.ones((2 * dv + 1, 2 * du + 1), np.uint8))
    camera, z = image.intrinsics, pixels.xyz[:, 2]
    u = np.rint(camera.fx * pixels.xyz[:, 0] / z + camera.cx).astype(int) - left
    v = np.rint(camera.fy * pixels.xyz[:, 1] / z + camera.cy).astype(int) - top
    return bool(near[v.clip(0, len(near) - 1), u.clip(0, near.shape[1] - 1)].any())
