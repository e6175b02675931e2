# SPDX-License-Identifier: Apache-2.0
"""How well the grey of two views correlates where one is laid into the other's image.

The same print seen from two sides has another size and another shape in either picture, so what a high pass leaves of
it in the one is not what it leaves in the other. So each view is drawn into the other's image first, through the depth,
and both are high-passed there, by the same window over the same pixels. Each pixel is divided by the contrast in its
window too: else the few strong edges between a dark floor and a bright table decide, which are alike in many rooms.
"""

from __future__ import annotations

import cv2
import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.visibility import (
    SHADED,
    SHADELESS,
    SMOOTH,
    SUM_A,
    SUM_AA,
    SUM_AB,
    SUM_B,
    SUM_BB,
    Sight,
    correlation,
)

WINDOW = 15  # px: its mean is the slow part of grey; a wide one tells rooms apart best
NARROW = 9  # px: sees best that a pose was pushed
CONTRAST = 3.0  # grey levels that are added to the contrast of a window: sensor noise is no print
COVERED = 0.1  # weight of the points about a pixel from which on it has a grey
COUNTS = 10  # of `visibility.count`
OURS, THEIRS = [SUM_A, SUM_AA], [SUM_B, SUM_BB]


def texture(source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams) -> float:
    """The correlation -1..1 over what both see, both ways; 0 where that is next to nothing. Both must have grey."""
    forward = compare(source, target, T_target_source, params)
    backward = compare(target, source, inverse(T_target_source), params)
    backward[OURS + THEIRS] = backward[THEIRS + OURS]  # the source's grey first: one picture may have more contrast
    return float(correlation(forward + backward))


def compare(asked: Sight, seen: Sight, T_seen_asked: Array, params: RegistrarParams, window: int = WINDOW) -> Array:
    """The sums (10,) of `visibility.count` for a correlation, over the pixels of ``seen`` that ``asked`` meets."""
    image, slops = (seen.near, seen.far, seen.camera), (params.depth_tolerance, params.depth_tolerance_growth)
    laid = cv2.GaussianBlur(_laid(asked.points, asked.grey.shades, T_seen_asked, image, slops), (0, 0), SMOOTH)
    both = ((laid[..., 1] > COVERED) & (seen.grey.detail < SHADELESS)).astype(np.float32)
    theirs, ours = both * laid[..., 0] / np.maximum(laid[..., 1], COVERED), both * seen.grey.detail
    layers = np.dstack([both, theirs, ours, theirs * theirs, ours * ours])
    return np.asarray(_sums(both, theirs, ours, cv2.blur(layers, (window, window))))


@numba.njit(cache=True, nogil=True)
def _laid(points, greys, T, image, slops):  # type: ignore[no-untyped-def]
    """The grey of ``points`` moved by ``T`` where ``image`` agrees with their depth, spread over four pixels each.

    (h, w, 2) float32: the sums of grey and of weights.
    """
    near, far, (fx, fy, cx, cy) = image
    height, width = near.shape
    out = np.zeros((height, width, 2), np.float32)
    for i in range(len(points)):
        px, py, pz, grey = points[i, 0], points[i, 1], points[i, 2], greys[i]
        z = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3]
        if z < 0.1 or grey >= SHADELESS:
            continue
        u = fx * (T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]) / z + cx
        v = fy * (T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3]) / z + cy
        if u < 0.0 or v < 0.0 or u > width - 1.001 or v > height - 1.001:
            continue
        low, high = near[int(v + 0.5), int(u + 0.5)], far[int(v + 0.5), int(u + 0.5)]
        slop = slops[0] + slops[1] * z * z
        if high <= 0.0 or z < low - slop or z > high + slop:
            continue
        left, top = int(u), int(v)
        a, b = u - left, v - top
        for row, down in ((top, 1.0 - b), (top + 1, b)):
            for column, right in ((left, 1.0 - a), (left + 1, a)):
                out[row, column, 0] += down * right * grey
                out[row, column, 1] += down * right
    return out


@numba.njit(cache=True, nogil=True)
def _sums(both, theirs, ours, means):  # type: ignore[no-untyped-def]
    """The sums over two greys, each less its mean and by its contrast about a pixel, where ``both (h, w)`` have one."""
    out = np.zeros(COUNTS)
    for row in range(both.shape[0]):
        for column in range(both.shape[1]):
            if both[row, column] == 0.0:
                continue
            share = means[row, column, 0]
            mean_a, mean_b = means[row, column, 1] / share, means[row, column, 2] / share
            a = (theirs[row, column] - mean_a) / _contrast(mean_a, means[row, column, 3] / share)
            b = (ours[row, column] - mean_b) / _contrast(mean_b, means[row, column, 4] / share)
            out[SHADED] += 1.0
            out[SUM_A] += a
            out[SUM_B] += b
            out[SUM_AA] += a * a
            out[SUM_BB] += b * b
            out[SUM_AB] += a * b
    return out


@numba.njit(cache=True, nogil=True)
def _contrast(mean, mean_square):  # type: ignore[no-untyped-def]
    """What a difference from the mean is measured by: the standard deviation, and what is noise at least."""
    return np.sqrt(max(mean_square - mean * mean, 0.0)) + CONTRAST
