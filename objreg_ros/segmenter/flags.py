# SPDX-License-Identifier: Apache-2.0
"""What holds for an object as a whole: whether something cuts it, and whether it is a patch of a wall."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array, DepthImage, PointFlag
from objreg_ros.segmenter.extract import Pixels
from objreg_ros.segmenter.support import FLOOR, GROWTH
from objreg_ros.segmenter.surface import EXACT, Surface, Window

LEAK = 0.08  # an object with more of it outside its box is cut by the box
NEAR_BORDER = 0.012  # of the image's size
FLAT = 0.85  # share of a wall-like object's cells on one plane
WALL_AROUND = 0.4  # share of the cells around it on the same plane
MIN_CELLS = 100
STRIDE = 2


def whole_flags(image: DepthImage, pixels: Pixels, around: Surface, chosen: Array, box: Window) -> PointFlag:
    """The flags of an object of ``pixels``, that is ``chosen (h, w) bool`` of ``around``; ``box`` in cells of that."""
    flags = PointFlag(0)
    inside = int(np.count_nonzero(chosen[box[1] : box[3], box[0] : box[2]]))
    if inside < (1 - LEAK) * int(np.count_nonzero(chosen)):
        flags |= PointFlag.CUT_BY_BOX
    if len(pixels) > 0 and _touches_border(pixels, *image.depth.shape):
        flags |= PointFlag.CUT_BY_IMAGE
    if inside > MIN_CELLS and _wall_like(around, chosen, box):
        flags |= PointFlag.WALL_LIKE
    return flags


def _touches_border(pixels: Pixels, height: int, width: int) -> bool:
    x0, y0, x1, y1 = pixels.bounds
    du, dv = max(1, round(NEAR_BORDER * width)), max(1, round(NEAR_BORDER * height))
    return x0 < du or y0 < dv or x1 > width - du or y1 > height - dv


def _wall_like(around: Surface, chosen: Array, box: Window) -> bool:
    """Whether the chosen cells are flat and their plane goes on around the box."""
    grid = (around.depth, around.x, around.y)
    moments = np.zeros(10)
    _sum_moments(*grid, chosen, moments)
    centre = moments[1:4] / moments[0]
    xx, xy, xz, yy, yz, zz = moments[4:]
    M = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / moments[0] - np.outer(centre, centre)
    normal = np.linalg.eigh(M)[1][:, 0]
    counts = np.zeros((2, 2))
    _count_on_plane(*grid, chosen, np.array(box), normal.astype(np.float32), np.float32(normal @ centre), counts)
    (own, own_flat), (ring, ring_flat) = counts
    return bool(own_flat > FLAT * own and ring > MIN_CELLS / STRIDE**2 and ring_flat > WALL_AROUND * ring)


@numba.njit(cache=True, fastmath=EXACT)
def _sum_moments(depth, x, y, chosen, moments):  # type: ignore[no-untyped-def]
    """Fill ``moments`` with the number, the sum of p and the sum of p pᵀ of every other chosen cell."""
    for i in range(0, depth.shape[0], STRIDE):
        for j in range(0, depth.shape[1], STRIDE):
            if chosen[i, j]:
                z = np.float64(depth[i, j])
                p, q = x[j] * z, y[i] * z
                moments[0] += 1
                moments[1] += p
                moments[2] += q
                moments[3] += z
                moments[4] += p * p
                moments[5] += p * q
                moments[6] += p * z
                moments[7] += q * q
                moments[8] += q * z
                moments[9] += z * z


@numba.njit(cache=True, fastmath=EXACT)
def _count_on_plane(depth, x, y, chosen, box, normal, offset, counts):  # type: ignore[no-untyped-def]
    """Fill ``counts``: of the chosen cells in the box and of all outside it, how many there are and are flat."""
    for i in range(0, depth.shape[0], STRIDE):
        for j in range(0, depth.shape[1], STRIDE):
            z = depth[i, j]
            outside = i < box[1] or i >= box[3] or j < box[0] or j >= box[2]
            if z <= 0 or not (outside or chosen[i, j]):
                continue
            k = 1 if outside else 0
            off = abs(z * (normal[0] * x[j] + normal[1] * y[i] + normal[2]) - offset)
            counts[k, 0] += 1
            counts[k, 1] += off < 2 * (FLOOR + GROWTH * z * z)
