# SPDX-License-Identifier: Apache-2.0
"""What around a box is support surface: the cells within the noise of a level plane, fitted anew where the box is.

A depth camera bends planes by some millimetres over the frame, so only a local fit tells a thin book from its table.
"""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.support import FLOOR, GROWTH, Ground, Plane, Support, fit_level
from objreg_ros.segmenter.surface import EXACT, Surface, Window

OWN_TOP = 0.65  # a level part with more of it in a box is a top of the object there, not what it stands on
LOWEST = 0.1  # with less than this share of the box's cells below it a level part is no top
MIN_NEAR = 12  # coarse cells of a part around a box that say something
REACH = np.ones((7, 7), np.uint8)  # coarse cells that a support surface is thought to go on
SPREADS = 3.0  # standard deviations of the surface's noise
MAX_SPREAD = 0.5  # tolerances; what is rougher is no plane


def support_cells(around: Surface, window: Window, ground: Ground, base: float) -> tuple[Array, bool]:
    """(h, w) bool: the cells of ``around`` that are support surfaces, and whether there is one.

    ``window`` is the box in cells of the whole frame, ``around`` a crop of it; ``base`` metres are added to the noise.
    """
    level = np.zeros(around.depth.shape, np.bool_)
    found = False
    if ground.up is None:
        return level, found
    for support in ground.supports:
        here = _beneath(support, window, around, ground.coarse)
        if here is None:
            continue
        plane = fit_level(around, here, ground.up, support.plane, stride=2, lowest=True)
        if plane is None or plane.spread > MAX_SPREAD:
            plane = support.plane
        limit = np.float32(SPREADS * min(plane.spread, MAX_SPREAD))
        _mark(around.depth, around.x, around.y, here, *_equation(plane), np.float32(base), limit, level)
        found = True
    return level, found


def _equation(plane: Plane) -> tuple[Array, np.float32]:
    return plane.normal.astype(np.float32), np.float32(plane.offset)


def _beneath(support: Support, window: Window, around: Surface, coarse: Surface) -> Array | None:
    """(h, w) bool of ``around``: where ``support`` may be what the things in ``window`` stand on; None for nowhere.

    A part that lies mostly in the window is a top of the object itself, unless more of its plane is seen around it, or
    nothing is seen below it.
    """
    stride = coarse.step // around.step  # 1 or more
    left, top = around.left // coarse.step, around.top // coarse.step
    h, w = around.depth.shape
    right, bottom = left + -(-(w + stride) // stride), top + -(-(h + stride) // stride)
    parts = np.ascontiguousarray(support.parts[top:bottom, left:right])
    near = np.bincount(parts.ravel(), minlength=len(support.total))
    near[0] = 0
    if near.sum() < MIN_NEAR:
        return None
    inside = tuple(-(-edge // stride) for edge in window)
    within = np.bincount(support.parts[inside[1] : inside[3], inside[0] : inside[2]].ravel(), minlength=len(near))
    own = within > OWN_TOP * support.total
    own[0] = False
    lone = near[~own].sum() <= near[own].sum()
    if lone and own.any() and _share_below(support.plane, around, window) > LOWEST:
        kept = ~own
    else:
        kept = np.ones(len(near), bool)
    kept &= near >= MIN_NEAR
    kept[0] = False
    if not kept.any():
        return None
    mask = cv2.dilate(kept[parts].view(np.uint8), REACH)
    here = np.zeros(around.depth.shape, np.bool_)
    rows = np.minimum((around.top + np.arange(h) * around.step) // coarse.step - top, mask.shape[0] - 1)
    cols = np.minimum((around.left + np.arange(w) * around.step) // coarse.step - left, mask.shape[1] - 1)
    _spread(mask, rows, cols, around.depth, here)
    return here


@numba.njit(cache=True)
def _spread(mask, rows, cols, depth, here):  # type: ignore[no-untyped-def]
    for i in range(here.shape[0]):
        for j in range(here.shape[1]):
            here[i, j] = mask[rows[i], cols[j]] > 0 and depth[i, j] > 0


def _share_below(plane: Plane, around: Surface, window: Window) -> float:
    """Which share of the cells in ``window`` lies well below ``plane``."""
    left, top = around.left // around.step, around.top // around.step
    rows, cols = slice(window[1] - top, window[3] - top), slice(window[0] - left, window[2] - left)
    depth = around.depth[rows, cols]
    ray = plane.normal.astype(np.float32)
    height = depth * (ray[0] * around.x[None, cols] + ray[1] * around.y[rows, None] + ray[2]) + np.float32(plane.offset)
    known = depth > 0
    below = known & (height < -(np.float32(FLOOR) + np.float32(GROWTH) * depth**2))
    return int(np.count_nonzero(below)) / max(1, int(np.count_nonzero(known)))


@numba.njit(cache=True, fastmath=EXACT)
def _mark(depth, x, y, here, n, offset, base, limit, level):  # type: ignore[no-untyped-def]
    """Mark the cells within base + limit · tolerance of the plane."""
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            height = z * (n[0] * x[j] + n[1] * y[i] + n[2]) + offset
            if here[i, j] and abs(height) < base + limit * (np.float32(FLOOR) + np.float32(GROWTH) * z * z):
                level[i, j] = True
