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


@numba.njit(cache=True)
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
    full = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    if full.shape == (step * height, step * width):
        return np.asarray(cv2.resize(full, (width, height), interpolation=cv2.INTER_AREA))
    _mean(full, step, grey)
    return grey


@numba.njit(cache=True)
def _mean(full, step, grey):  # type: ignore[no-untyped-def]
    total, count = np.empty(grey.shape[1], np.int32), np.empty(grey.shape[1], np.int32)
    for i in range(grey.shape[0]):
        total[:], count[:] = 0, 0
        for v in range(i * step, min((i + 1) * step, full.shape[0])):
            for u in range(step):
                row = full[v, u:]
                for j in range(min(len(total), (len(row) + step - 1) // step)):
                    total[j] += row[j * step]
                    count[j] += 1
        for j in range(grey.shape[1]):
            grey[i, j] = total[j] // count[j]
