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

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse
from objreg_ros.registration.kernels.projection import FAST, project, spread, visible
from objreg_ros.registration.prepare.views import SHADELESS, SMOOTH, Sight
from objreg_ros.registration.score.free_space import SHADED, SUM_A, SUM_AA, SUM_AB, SUM_B, SUM_BB, correlation
from objreg_ros.sensor import depth_tolerance

WINDOW = 15  # px: its mean is the slow part of grey; a wide one separates rooms best
NARROW = 9  # px: sees best that a pose was perturbed
CONTRAST = 3.0  # grey levels that are added to the contrast of a window: sensor noise is no print
COVERED = 0.1  # weight of the points about a pixel from which on it has a grey
COUNTS = 10  # of `free_space.count`
LAYERS = 5  # that are summed in a window: where there is grey, either grey, and its square
OURS, THEIRS = [SUM_A, SUM_AA], [SUM_B, SUM_BB]


def correlate_views(source: Sight, target: Sight, T_target_source: Array) -> float:
    """The correlation -1..1 over what both see, both ways; 0 where that is next to nothing. Both must have grey."""
    forward = compare(source, target, T_target_source)
    backward = compare(target, source, inverse(T_target_source))
    backward[OURS + THEIRS] = backward[THEIRS + OURS]  # the source's grey first: one picture may have more contrast
    return float(correlation(forward + backward))


def compare(asked: Sight, seen: Sight, T_seen_asked: Array, window: int = WINDOW) -> Array:
    """The sums (10,) of `free_space.count` for a correlation, over the pixels of ``seen`` that ``asked`` meets."""
    slops = depth_tolerance(asked.noise, seen.noise)
    laid = _laid(asked.grey.points, asked.grey.shades, T_seen_asked, seen.near, seen.far, seen.camera, slops)
    return np.asarray(_sums(cv2.GaussianBlur(laid, (0, 0), SMOOTH), seen.grey.detail, window))


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _laid(points, greys, T, near, far, camera, slops):  # type: ignore[no-untyped-def]
    """The grey of ``points`` moved by ``T`` where an image agrees with their depth, spread over four pixels each.

    (h, w, 2) float32: the sums of grey and of weights.
    """
    out = np.zeros((*near.shape, 2), np.float32)
    us, vs, zs = project(points, T, camera)
    for i in visible(us, vs, zs, near, far, slops[0], slops[1]):
        spread(out, us[i], vs[i], greys[i])
    return out


@numba.njit(cache=True, nogil=True)
def _sums(laid, detail, window):  # type: ignore[no-untyped-def]
    """The sums over two greys, each less its mean and by its contrast in a window about a pixel, where both have one.

    ``laid (h, w, 2)`` is a smoothed grey times its weight, and the weight; ``detail (h, w)`` is the other. Beyond the
    rim of the image lies its mirror. The sums in the window run along: each pixel enters and leaves them but once.
    """
    both, theirs, ours = _greys(laid, detail)
    (height, width), half = detail.shape, window // 2
    columns, sums, out = np.zeros((LAYERS, width + window)), np.empty((LAYERS, width)), np.zeros(COUNTS)
    for row in range(-half, half):
        _add_row(both, theirs, ours, _mirrored(row, height), 1.0, columns, half)
    for row in range(height):
        _add_row(both, theirs, ours, _mirrored(row + half, height), 1.0, columns, half)
        _mirror_rim(columns, half, width)
        _run(columns, window, sums)
        _compare_row(both[row], theirs[row], ours[row], sums, out)
        _add_row(both, theirs, ours, _mirrored(row - half, height), -1.0, columns, half)
    return out


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _greys(laid, detail):  # type: ignore[no-untyped-def]
    """Where both have a grey, 1 or 0 (h, w) float32; and their greys there, 0 elsewhere."""
    both, theirs, ours = np.empty_like(detail), np.empty_like(detail), np.empty_like(detail)
    least = np.float32(COVERED)
    for row in range(detail.shape[0]):
        for column in range(detail.shape[1]):
            weight, grey = laid[row, column, 1], detail[row, column]
            covered = np.float32((weight > least) & (grey < SHADELESS))
            both[row, column] = covered
            theirs[row, column] = covered * laid[row, column, 0] / max(weight, least)
            ours[row, column] = covered * grey
    return both, theirs, ours


@numba.njit(cache=True, nogil=True)
def _mirrored(place, size):  # type: ignore[no-untyped-def]
    """The row or column that is seen in a place beyond the first or the last."""
    return max(0, min(abs(place), 2 * size - 2 - place, size - 1))


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _add_row(both, theirs, ours, row, sign, columns, half):  # type: ignore[no-untyped-def]
    """Add a row of the images to the sums (5, w + window) over the window's rows, of each column."""
    for column in range(both.shape[1]):
        a, b = float(theirs[row, column]), float(ours[row, column])
        columns[0, half + column] += sign * both[row, column]
        columns[1, half + column] += sign * a
        columns[2, half + column] += sign * b
        columns[3, half + column] += sign * a * a
        columns[4, half + column] += sign * b * b


@numba.njit(cache=True, nogil=True)
def _mirror_rim(columns, half, width):  # type: ignore[no-untyped-def]
    """Fill the columns on either side of the image."""
    for k in range(half):
        left, right = half + _mirrored(k - half, width), half + _mirrored(width + k, width)
        for layer in range(LAYERS):
            columns[layer, k] = columns[layer, left]
            columns[layer, half + width + k] = columns[layer, right]


@numba.njit(cache=True, nogil=True)
def _run(columns, window, sums):  # type: ignore[no-untyped-def]
    """The sums (5, w) of the columns in the window about each pixel of a row; all at once, as each waits for itself."""
    n, a, b, aa, bb = columns[0, 0], columns[1, 0], columns[2, 0], columns[3, 0], columns[4, 0]
    for k in range(1, window):
        n, a, b = n + columns[0, k], a + columns[1, k], b + columns[2, k]
        aa, bb = aa + columns[3, k], bb + columns[4, k]
    for k in range(sums.shape[1]):
        sums[0, k], sums[1, k], sums[2, k], sums[3, k], sums[4, k] = n, a, b, aa, bb
        enters = k + window
        n += columns[0, enters] - columns[0, k]
        a += columns[1, enters] - columns[1, k]
        b += columns[2, enters] - columns[2, k]
        aa += columns[3, enters] - columns[3, k]
        bb += columns[4, enters] - columns[4, k]


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _compare_row(both, theirs, ours, sums, out):  # type: ignore[no-untyped-def]
    """Add the pixels of a row to the sums ``out (10,)``, given those of the windows about them."""
    shaded = sum_a = sum_b = sum_aa = sum_bb = sum_ab = 0.0
    for k in range(len(both)):
        if both[k] == 0.0:
            continue
        share = 1.0 / sums[0, k]
        mean_a, mean_b = sums[1, k] * share, sums[2, k] * share
        a = (theirs[k] - mean_a) / _contrast(mean_a, sums[3, k] * share)
        b = (ours[k] - mean_b) / _contrast(mean_b, sums[4, k] * share)
        shaded += 1.0
        sum_a += a
        sum_b += b
        sum_aa += a * a
        sum_bb += b * b
        sum_ab += a * b
    out[SHADED] += shaded
    out[SUM_A] += sum_a
    out[SUM_B] += sum_b
    out[SUM_AA] += sum_aa
    out[SUM_BB] += sum_bb
    out[SUM_AB] += sum_ab


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _contrast(mean, mean_square):  # type: ignore[no-untyped-def]
    """What a difference from the mean is measured by: the standard deviation, and what is noise at least."""
    return np.sqrt(max(mean_square - mean * mean, 0.0)) + CONTRAST
