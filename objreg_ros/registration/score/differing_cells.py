# SPDX-License-Identifier: Apache-2.0
"""Which of two places a view shows, where both fit: by the cells of its picture in which they differ.

A sum over the whole view hardly changes for one poster or one book. So the view is cut into cells, and each is compared
with what either place shows there, laid into the view through the depth. A cell speaks for a place that shows the same
there, in depth and in grey, while the other place shows something else, or nothing where the view shows a thing.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.sensor import DEPTH_TOLERANCE_GROWTH, DEPTH_TOLERANCE_M

CELL_PX = 11  # of a view of 160 columns: 4 degrees
SHIFT_PX = 2  # by which a right pose is off in the picture
CONTRAST = 6.0  # grey levels within a cell, below which grey says nothing
SAME, OTHER = 0.7, 0.3  # correlation of what shows the same, and of what does not
COVERED = 0.6  # of a cell that must be comparable
FLOATS = 3.0  # tolerances of depth in front of what was seen


class CellVotes(NamedTuple):
    """How many cells speak ``for_first`` and ``for_second``, of those ``compared`` that both places show."""

    for_first: int
    for_second: int
    compared: int


class Laid(NamedTuple):
    """What a place shows in each pixel of a view: ``grey (h, w) float32``, ``agrees`` and ``floats (h, w) bool``.

    ``agrees`` where the depth of the view is that of the place, ``floats`` where the place has free space.
    """

    grey: Array
    agrees: Array
    floats: Array


def vote(view: View, first: View, T_first_view: Array, second: View, T_second_view: Array) -> CellVotes:
    """How the cells of a view speak for two places, seen by two other views, with the view's pose (4, 4) in each.

    No votes where a view has no grey.
    """
    if view.grey is None or first.grey is None or second.grey is None:
        return CellVotes(0, 0, 0)
    one, other = laid(view, first, T_first_view), laid(view, second, T_second_view)
    likeness = [_likeness(view.grey, shown) for shown in (one, other)]
    contrast = _spread(view.grey.astype(np.float32))
    same = [(like >= SAME) & (contrast >= CONTRAST) for like in likeness]
    differs = [((like <= OTHER) & (contrast >= CONTRAST)) | _mostly(s.floats) for like, s in zip(likeness, (one, other), strict=True)]
    for_first, for_second = same[0] & differs[1], same[1] & differs[0]
    compared = (same[0] | differs[0]) & (same[1] | differs[1])
    return CellVotes(*(int(cells[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX].sum()) for cells in (for_first, for_second, compared)))


def laid(view: View, place: View, T_place_view: Array) -> Laid:
    """What ``place`` shows where the points of ``view`` lie under a pose (4, 4)."""
    xyz = view.xyz.reshape(-1, 3).astype(float) @ T_place_view[:3, :3].T + T_place_view[:3, 3]
    k, (h, w) = place.intrinsics, view.xyz.shape[:2]
    ahead = np.isfinite(xyz[:, 2]) & (xyz[:, 2] > 0.1)
    z = np.where(ahead, xyz[:, 2], 1.0)
    u = np.where(ahead, k.fx * xyz[:, 0] / z + k.cx, -1e3).reshape(h, w).astype(np.float32)
    v = np.where(ahead, k.fy * xyz[:, 1] / z + k.cy, -1e3).reshape(h, w).astype(np.float32)
    assert place.grey is not None
    grey = cv2.remap(place.grey.astype(np.float32), u, v, cv2.INTER_LINEAR, borderValue=np.nan)
    depth = np.nan_to_num(place.xyz[..., 2], nan=0.0)
    far, near = (edge(depth, np.ones((3, 3), np.uint8)) for edge in (cv2.dilate, cv2.erode))
    seen_far, seen_near = (cv2.remap(d, u, v, cv2.INTER_NEAREST, borderValue=0.0) for d in (far, near))
    measured, z = (seen_near > 0.0) & ahead.reshape(h, w), z.reshape(h, w)
    slop = DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH * z * z
    agrees = measured & (z > seen_near - slop) & (z < seen_far + slop)
    return Laid(grey, agrees, measured & (z < seen_near - FLOATS * slop))


def _likeness(grey: Array, shown: Laid) -> Array:
    """(h, w) the correlation of grey in the cell around each pixel, at the best small shift; NaN where none is known."""
    known = shown.agrees & np.isfinite(shown.grey)
    theirs = np.where(known, shown.grey, 0.0).astype(np.float32)
    best = np.full(grey.shape, -1.0, np.float32)
    steps = range(-SHIFT_PX, SHIFT_PX + 1)
    for dx in steps:
        for dy in steps:
            moved, there = (np.roll(part, (dy, dx), (0, 1)) for part in (theirs, known))
            best = np.maximum(best, _correlation(grey.astype(np.float32), moved, there))
    return np.where(_mostly(known), best, np.nan)


def _correlation(a: Array, b: Array, known: Array) -> Array:
    weight = known.astype(np.float32)
    share = np.maximum(_mean(weight), 1e-6)
    mean_a, mean_b = _mean(a * weight) / share, _mean(b * weight) / share
    ab = _mean(a * b * weight) / share - mean_a * mean_b
    aa = _mean(a * a * weight) / share - mean_a**2
    bb = _mean(b * b * weight) / share - mean_b**2
    return np.asarray(ab / np.sqrt(np.maximum(aa, 1.0) * np.maximum(bb, 1.0)))


def _spread(grey: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(_mean(grey * grey) - _mean(grey) ** 2, 0.0)))


def _mostly(yes: Array) -> Array:
    return np.asarray(_mean(yes.astype(np.float32)) >= COVERED)


def _mean(values: Array) -> Array:
    return cv2.blur(values, (CELL_PX, CELL_PX), borderType=cv2.BORDER_REFLECT)
