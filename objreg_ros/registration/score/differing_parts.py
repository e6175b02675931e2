# SPDX-License-Identifier: Apache-2.0
"""Which of two places a view shows, where both fit: by the parts of its picture in which the places differ.

A sum over the whole view hardly changes for one poster or one book. So what either place shows is laid into the view
through the depth, and brought upon it in the picture (Evangelidis and Psarakis, "Parametric image alignment using
enhanced correlation coefficient maximization", 2008), since a right pose is some pixels off. A part speaks for the
place that shows the same there, while the other place shows another grey, or free space where the view has a surface.
Where a place does not look the same in most of the view, light or pose differ too much, and nothing speaks.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.sensor import DEPTH_TOLERANCE_GROWTH, DEPTH_TOLERANCE_M

CELL_PX = 7  # of a view of 160 columns: 3 degrees, over which grey is compared
SAME, OTHER = 10.0, 22.0  # grey levels between what shows the same, at most, and what does not, at least
LEAST_SAME = 0.85  # of what can be compared, that shows the same
LEAST_KNOWN = 1000  # pixels that can be compared
COVERED = 0.6  # of a cell that must be known
FLOATS = 3.0  # tolerances of depth in front of what was seen
LEAST_PART_PX = 20  # of a part: less is an edge
ROUNDS = 4  # of the fit of exposure
GAIN = 0.7, 1.4  # of exposure
MOST_WARP_PX = 8.0  # of the corners of the picture
CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 1e-3)


class Parts(NamedTuple):
    """How many pixels speak ``for_first`` and ``for_second``, each in parts of some size."""

    for_first: int
    for_second: int


class Laid(NamedTuple):
    """What a place shows in each pixel of a view: ``grey (h, w) float32``; bool (h, w) are where it is ``known``, as
    the depths agree, and where the view ``floats`` in the free space of the place.
    """

    grey: Array
    known: Array
    floats: Array


def differing_parts(view: View, first: View, T_first_view: Array, second: View, T_second_view: Array) -> Parts:
    """What of a view speaks for either of two places, seen by two other views, by the view's pose (4, 4) in each.

    Nothing where a view has no grey, or one of the places looks different in much of the view.
    """
    if view.grey is None or first.grey is None or second.grey is None:
        return Parts(0, 0)
    grey, same, differs = view.grey.astype(np.float32), [], []
    for place, T in ((first, T_first_view), (second, T_second_view)):
        shown = laid(view, place, T)
        apart = _difference(grey, shown)
        if apart is None:
            return Parts(0, 0)
        same.append(apart <= SAME)
        differs.append((apart >= OTHER, _mostly(shown.floats)))
    return Parts(_parts(same[0], differs[1]), _parts(same[1], differs[0]))


def _parts(same: Array, differs: tuple[Array, Array]) -> int:
    """The pixels of all parts of some size."""
    total = 0
    for other in differs:
        _, _, found, _ = cv2.connectedComponentsWithStats((same & other).astype(np.uint8))
        sizes = found[1:, cv2.CC_STAT_AREA]
        total += int(sizes[sizes >= LEAST_PART_PX].sum())
    return total


def laid(view: View, place: View, T_place_view: Array) -> Laid:
    """What ``place`` shows where the points of ``view`` lie under a pose (4, 4). Both must have grey."""
    assert place.grey is not None
    h, w = view.xyz.shape[:2]
    x, y, z = (view.xyz.reshape(-1, 3).astype(float) @ T_place_view[:3, :3].T + T_place_view[:3, 3]).T
    ahead, k = np.isfinite(z) & (z > 0.1), place.intrinsics
    z = np.where(ahead, z, 1.0)
    u = np.where(ahead, k.fx * x / z + k.cx, -1e3).reshape(h, w).astype(np.float32)
    v = np.where(ahead, k.fy * y / z + k.cy, -1e3).reshape(h, w).astype(np.float32)
    grey = cv2.remap(place.grey.astype(np.float32), u, v, cv2.INTER_LINEAR, borderValue=np.nan)
    depth, window = np.nan_to_num(place.xyz[..., 2], nan=0.0), np.ones((3, 3), np.uint8)
    far, near = (
        cv2.remap(edge(depth, window), u, v, cv2.INTER_NEAREST, borderValue=0.0) for edge in (cv2.dilate, cv2.erode)
    )
    measured, z = (near > 0.0) & ahead.reshape(h, w), z.reshape(h, w)
    slop = DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH * z * z
    known = measured & (z > near - slop) & (z < far + slop) & np.isfinite(grey)
    return Laid(np.where(known, grey, 0.0).astype(np.float32), known, measured & (z < near - FLOATS * slop))


def _difference(grey: Array, shown: Laid) -> Array | None:
    """(h, w) grey levels between the cells around each pixel, at the best shift by a pixel; NaN where not known.

    None where too little is known, or too little is the same.
    """
    if shown.known.sum() < LEAST_KNOWN:
        return None
    theirs, known = _aligned(grey, shown)
    if known.sum() < LEAST_KNOWN:
        return None
    theirs = _exposed_as(grey, theirs, known)
    best = np.full(grey.shape, np.inf, np.float32)
    for shift in product((-1, 0, 1), repeat=2):
        moved, there = np.roll(theirs, shift, (0, 1)), np.roll(known, shift, (0, 1)).astype(np.float32)
        share = _mean(there)
        apart = _mean(np.abs(grey - moved) * there) / np.maximum(share, 1e-6)
        best = np.where(share >= COVERED, np.minimum(best, apart), best)
    comparable = np.isfinite(best)
    if not comparable.any() or np.mean(best[comparable] <= SAME) < LEAST_SAME:
        return None
    return np.where(comparable, best, np.nan)


def _aligned(grey: Array, shown: Laid) -> tuple[Array, Array]:
    """What is shown, and where it is known, warped onto the picture; as it is where no small warp is found."""
    warp, (h, w) = np.eye(2, 3, dtype=np.float32), grey.shape
    filled = np.where(shown.known, shown.grey, cv2.blur(grey, (5, 5))).astype(np.float32)
    inner = cv2.erode(shown.known.astype(np.uint8), np.ones((3, 3), np.uint8))
    try:
        _, warp = cv2.findTransformECC(grey, filled, warp, cv2.MOTION_AFFINE, CRITERIA, inner, 3)
    except cv2.error:  # it did not converge
        return shown.grey, shown.known
    corners = np.array([[0, 0, 1], [w, 0, 1], [0, h, 1], [w, h, 1]], float)
    if np.abs(corners @ warp.T - corners[:, :2]).max() > MOST_WARP_PX:
        return shown.grey, shown.known
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    known = cv2.warpAffine(shown.known.astype(np.float32), warp, (w, h), flags=how)
    return cv2.warpAffine(shown.grey, warp, (w, h), flags=how), np.asarray(known > 0.99)


def _exposed_as(grey: Array, theirs: Array, known: Array) -> Array:
    """``theirs`` as bright and as contrasty as ``grey`` where both are ``known``, by what of them is the same."""
    a, b = theirs[known], grey[known]
    gain, offset = 1.0, float(np.median(b - a))
    for _ in range(ROUNDS):
        apart = np.abs(gain * a + offset - b)
        kept = apart <= max(2.5 * float(np.median(apart)), 2.0)
        x, y = a[kept], b[kept]
        slope = float(np.mean((x - x.mean()) * (y - y.mean()))) / max(float(x.var()), 1.0)
        gain = min(max(slope, GAIN[0]), GAIN[1])
        offset = float(y.mean()) - gain * float(x.mean())
    return np.asarray(gain * theirs + offset, np.float32)


def _mostly(yes: Array) -> Array:
    return np.asarray(_mean(yes.astype(np.float32)) >= COVERED)


def _mean(values: Array) -> Array:
    return cv2.blur(values, (CELL_PX, CELL_PX), borderType=cv2.BORDER_REFLECT)
