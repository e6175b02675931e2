# SPDX-License-Identifier: Apache-2.0
"""The frame at reduced size: every step-th pixel as a point, and the grey value around it."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data import Array, DepthImage, View

LEAST_WIDTH = 160  # px: what a narrower view holds is too coarse to tell where a pose is
RED, GREEN, BLUE = np.float32(0.299), np.float32(0.587), np.float32(0.114)  # shares of grey, ITU-R BT.601


def step_for(width: int, most: int) -> int:
    """The step of the view of a picture so many pixels wide: ``most``, or what leaves `LEAST_WIDTH` columns."""
    return max(1, min(most, width // LEAST_WIDTH))


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
    xyz = np.empty((*depth.shape, 3), np.float32)
    _back_project(depth, x, y, np.float32(z_min), np.float32(z_max), xyz)
    grey = None if image.rgb is None else _grey(image.rgb, step, camera.height, camera.width)
    return View(xyz=xyz, grey=grey, intrinsics=camera)


@numba.njit(cache=True, nogil=True)
def _back_project(depth, x, y, z_min, z_max, xyz):  # type: ignore[no-untyped-def]
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            if not (z > z_min and z < z_max):
                z = np.float32(np.nan)
            xyz[i, j, 0] = x[j] * z
            xyz[i, j, 1] = y[i] * z
            xyz[i, j, 2] = z


def _grey(rgb: Array, step: int, height: int, width: int) -> Array:
    """The mean of each block, brought on to the pixel of its depth: half a pixel of the picture where step is even.

    Left out, it moves a pose between opposite views by millimetres along a table that is a metre away.
    """
    grey = np.empty((height, width), np.float32)
    _mean(rgb.reshape(rgb.shape[0], -1), step, grey)
    onward = (step // 2 - (step - 1) / 2) / step  # from the middle of the block to the pixel of its depth
    share = np.array([0.0, 1.0 - onward, onward])
    return np.rint(cv2.sepFilter2D(grey, -1, share, share, borderType=cv2.BORDER_REPLICATE)).astype(np.uint8)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mean(values, step, grey):  # type: ignore[no-untyped-def]
    """Each pixel: the mean grey of a block of ``values (H, 3 W)``; blocks at the right and lower border may be smaller.

    Sums run along whole rows, in integers, for the CPU's vectors; `step` is at most 32, so they fit into 16 bits and
    those of whole blocks into 32."""
    height, width = values.shape
    column, block = np.empty(width + 3 * step, np.uint16), np.empty(width, np.uint32)
    column[width:] = 0
    for i in range(grey.shape[0]):
        first, last = i * step, min((i + 1) * step, height)
        for u in range(width):
            column[u] = values[first, u]
        for v in range(first + 1, last):
            row = values[v]
            for u in range(width):
                column[u] += row[u]
        for u in range(width):
            block[u] = column[u]
        for k in range(1, step):
            beside = column[3 * k :]
            for u in range(width):
                block[u] += beside[u]
        for j in range(grey.shape[1]):
            u = 3 * j * step
            count = min(step, (width - u) // 3) * (last - first)
            total = RED * np.float32(block[u]) + GREEN * np.float32(block[u + 1]) + BLUE * np.float32(block[u + 2])
            grey[i, j] = total / np.float32(count)
