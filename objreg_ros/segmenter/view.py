# SPDX-License-Identifier: Apache-2.0
"""The frame at reduced size: every step-th pixel as a point, and the grey value around it."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data import Array, DepthImage, View


def reduced_view(image: DepthImage, step: int, z_min: float, z_max: float) -> View:
    """Every ``step``-th pixel from pixel ``step // 2`` on; points outside z_min … z_max metres are NaN.

    Colour becomes the mean grey (ITU-R BT.601) of the step × step block around the pixel; without colour grey is None.
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
    grey = np.empty((height, width), np.uint8)
    _mean(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), step, grey)
    return grey


@numba.njit(cache=True, nogil=True)
def _mean(full, step, grey):  # type: ignore[no-untyped-def]
    """Each pixel: the mean of a block; the blocks at the right and lower border may be smaller."""
    height, width = full.shape
    column = np.empty(width, np.int32)
    for i in range(grey.shape[0]):
        last = min((i + 1) * step, height)
        share = np.float32(1) / (last - i * step)
        column[:] = 0
        for v in range(i * step, last):
            row = full[v]
            for u in range(width):
                column[u] += row[u]
        for j in range(grey.shape[1]):
            end = min((j + 1) * step, width)
            total = np.int32(0)
            for u in range(j * step, end):
                total += column[u]
            grey[i, j] = int(total * share / (end - j * step) + np.float32(0.5))
