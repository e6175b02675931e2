# SPDX-License-Identifier: Apache-2.0
"""The flags of an object as a whole: whether something cuts it, and whether it is a patch of a wall."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.extract import Pixels
from objreg_ros.segmenter.surface.cells import EXACT, Surface, Window
from objreg_ros.segmenter.surface.support import solve_symmetric
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

LEAK = 0.08  # an object with more of it outside its box is cut by the box
NEAR_BORDER = 0.012  # of the image's size
FLAT = 0.85  # share of a wall-like object's cells on one plane
WALL_AROUND = 0.4  # share of the cells around it on the same plane
MIN_CELLS = 100
STRIDE = 2


def whole_flags(image: DepthImage, pixels: Pixels, around: Surface, chosen: Array, box: Window) -> PointFlag:
    """The flags of an object of ``pixels``, that is ``chosen (h, w) bool`` of ``around``; ``box`` in cells of that."""
    flags = PointFlag(0)
    cut, wall_like = _inspect(around.depth, around.x, around.y, chosen, box)
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


@numba.njit(cache=True, nogil=True)
def _inspect(depth, x, y, chosen, box):  # type: ignore[no-untyped-def]
    """Whether the box cuts the chosen cells; whether they are flat and their plane goes on around the box."""
    everywhere, inside = 0, 0
    for i in range(chosen.shape[0]):
        for j in range(chosen.shape[1]):
            everywhere += chosen[i, j]
    for i in range(box[1], box[3]):
        for j in range(box[0], box[2]):
            inside += chosen[i, j]
    cut = inside < (1 - LEAK) * everywhere
    if inside <= MIN_CELLS:
        return cut, False
    plane = _fit_plane(depth, x, y, chosen)
    own, own_flat, ring, ring_flat = _count_on_plane(depth, x, y, chosen, box, plane)
    flat = own_flat > FLAT * own
    return cut, flat and ring > MIN_CELLS / STRIDE**2 and ring_flat > WALL_AROUND * ring


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fit_plane(depth, x, y, chosen):  # type: ignore[no-untyped-def]
    """a, b, c of the plane 1/z = a x + b y + c through the chosen cells, and its slope √(a² + b² + c²).

    Least squares of inverse depth, of which the noise of structured light is the same at any distance."""
    m, m_x, m_y, m_xx, m_xy, m_yy, v, v_x, v_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(0, depth.shape[0], STRIDE):
        q = np.float64(y[i])
        for j in range(0, depth.shape[1], STRIDE):
            if chosen[i, j] and depth[i, j] > 0:
                p, near = np.float64(x[j]), 1 / np.float64(depth[i, j])
                m, m_x, m_y = m + 1, m_x + p, m_y + q
                m_xx, m_xy, m_yy = m_xx + p * p, m_xy + p * q, m_yy + q * q
                v, v_x, v_y = v + near, v_x + near * p, v_y + near * q
    ridge = 1e-12 * m
    c, a, b = solve_symmetric((m, m_x, m_y, m_xx + ridge, m_xy, m_yy + ridge), (v, v_x, v_y))
    return np.float32(a), np.float32(b), np.float32(c), np.float32(np.sqrt(a * a + b * b + c * c))


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _count_on_plane(depth, x, y, chosen, box, plane):  # type: ignore[no-untyped-def]
    """How many of the chosen cells in the box there are and are flat, and the same of all cells outside it."""
    own, own_flat, ring, ring_flat = 0, 0, 0, 0
    for i in range(0, depth.shape[0], STRIDE):
        for j in range(0, depth.shape[1], STRIDE):
            z = depth[i, j]
            off = abs(z * (plane[0] * x[j] + plane[1] * y[i] + plane[2]) - np.float32(1))
            flat = off < plane[3] * 2 * (PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z)
            if i < box[1] or i >= box[3] or j < box[0] or j >= box[2]:
                ring += z > 0
                ring_flat += (z > 0) & flat
            elif chosen[i, j]:
                own += 1
                own_flat += flat
    return own, own_flat, ring, ring_flat
