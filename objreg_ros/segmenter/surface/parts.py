# SPDX-License-Identifier: Apache-2.0
"""Properties of the connected parts in and around a box: size, place, and how they lie to each other."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import EXACT, Surface, Window

ACROSS = 3  # cells over which two parts are neighbours
ALIKE = 0.12  # how far apart the shares of red, green and blue of one colour are
DARK = 8.0  # grey values that are added to each colour: what is nearly black has none
RIM = 0.7  # how much less a cell at the rim of the box counts than one in its middle


class Parts(NamedTuple):
    """K connected parts of a surface, the largest in the box first, numbered from 1 in ``labels (h, w) int32``.

    Of each part: ``total (K,)`` its cells, ``weight (K,)`` those in the box where the middle counts more than the rim,
    ``extent (K, 4)`` left, top, right, bottom in cells, half open, ``size (K,)`` the length in metres of the box's
    longer side at the part's depth, ``pure (K,)`` which share of it lies in the box, ``figure (K,)`` which share of its
    depth jumps is its own silhouette, 1 where it has none.

    Of each pair: ``alike (K, K)`` whether they have one colour in whatever light, False without colour, ``touching
    (K, 1 + K)`` the cells in which they are neighbours without a depth jump, ``gap (K, 1 + K)`` m² the square of the
    least distance over a border, ``front (K, 1 + K)`` the cells in which the first hides the second; column 0 is what
    is no part.
    """

    labels: Array
    total: Array
    weight: Array
    extent: Array
    size: Array
    pure: Array
    figure: Array
    alike: Array
    touching: Array
    gap: Array
    front: Array


def measure(
    labels: Array, count: int, window: Window, surface: Surface, rgb: Array, jump: tuple[float, float], limit: int
) -> Parts:
    """The ``limit`` largest parts of ``labels (h, w) int32``, 0 … ``count``, by their cells in ``window``.

    ``rgb (H, W, 3) uint8`` is the whole picture, of height 0 without colour.
    """
    pixels = (surface.left, surface.top, surface.step)
    bounds = (np.float32(jump[0]), np.float32(jump[1]))
    measured = _measure(labels, count, window, surface.depth, surface.x, surface.y, pixels, rgb, bounds, limit)
    return Parts(*measured)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _measure(labels, count, window, depth, x, y, pixels, rgb, bounds, limit):  # type: ignore[no-untyped-def]
    """The fields of `Parts`. Plain loops: whole-array expressions would take ten times as long to compile."""
    number, kept = _rank(labels, count, window, limit)
    k = kept + 1
    renamed = np.empty_like(labels)
    sums, extent = np.zeros((k, 7)), np.zeros((k, 4), np.int64)
    _sum_up(labels, number, window, depth, pixels, rgb, renamed, sums, extent)
    touching, front, gap = np.zeros((k, k), np.int64), np.zeros((k, k), np.int64), np.empty((k, k), np.float32)
    for p in range(k):
        for q in range(k):
            gap[p, q] = np.inf
    _compare(renamed, depth, x, y, bounds, touching, front, gap)
    wide = x[1] - x[0] if len(x) > 1 else np.float32(0)
    high = y[1] - y[0] if len(y) > 1 else np.float32(0)
    longer = max((window[2] - window[0]) * wide, (window[3] - window[1]) * high)
    total, weight, size, pure, figure = _describe(sums, front, longer)
    alike = _alike(sums, len(rgb) > 0)
    return renamed, total, weight, extent[1:], size, pure, figure, alike, touching[1:], gap[1:], front[1:]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _describe(sums, front, longer):  # type: ignore[no-untyped-def]
    """Of each part, from 1 on: total, weight, size, pure and figure, each (K,)."""
    count = len(sums) - 1
    total, weight = np.empty(count), np.empty(count)
    size, pure, figure = np.empty(count), np.empty(count), np.empty(count)
    for p in range(count):
        k = p + 1
        total[p], weight[p] = sums[k, 0], sums[k, 2]
        size[p], pure[p] = longer * sums[k, 3] / sums[k, 0], sums[k, 1] / sums[k, 0]
        shown, hidden = 0, 0
        for o in range(count + 1):
            shown += front[k, o]
            hidden += front[o, k] if o > 0 else 0
        figure[p] = (shown + 1) / (shown + hidden + 1)
    return total, weight, size, pure, figure


@numba.njit(cache=True, nogil=True)
def _rank(labels, count, window, limit):  # type: ignore[no-untyped-def]
    """(count + 1,) the place of each label in the order of their cells in the window, 0 without any; the last place."""
    left, top, right, bottom = window
    inside, number = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int32)
    for i in range(top, bottom):
        for j in range(left, right):
            inside[labels[i, j]] += 1
    inside[0] = 0
    for place in range(1, limit + 1):
        most = 0
        for k in range(1, count + 1):
            if number[k] == 0 and inside[k] > inside[most]:
                most = k
        if most == 0:
            return number, place - 1
        number[most] = place
    return number, limit


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _sum_up(labels, number, window, depth, pixels, rgb, renamed, sums, extent):  # type: ignore[no-untyped-def]
    """Fill ``renamed`` and of each part its ``extent`` and the sums of its cells: all, those in the window, weighed by
    their place there, depth, red, green and blue; run by run, a run being the cells of one part in a row."""
    h, w = labels.shape
    first_u, first_v, step = pixels
    for i in range(h):
        row, out = labels[i], renamed[i]
        last = 0
        while last < w:
            first, label = last, row[last]
            while last < w and row[last] == label:
                last += 1
            k = number[label]
            total = np.float32(0)
            for j in range(first, last):
                out[j] = k
                total += depth[i, j]
            if k == 0:
                continue
            if sums[k, 0] == 0:
                extent[k, 0], extent[k, 1], extent[k, 2] = first, i, last
            extent[k, 0], extent[k, 2] = min(extent[k, 0], first), max(extent[k, 2], last)
            extent[k, 3] = i + 1
            sums[k, 0] += last - first
            sums[k, 3] += total
            _weigh(i, first, last, window, sums[k])
            if len(rgb) > 0:
                _add_colours(rgb[first_v + i * step], first_u, step, first, last, sums[k])


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _weigh(i, first, last, window, sums):  # type: ignore[no-untyped-def]
    """Add the cells first … last of row i that lie in the window to ``sums``."""
    left, top, right, bottom = window
    if not top <= i < bottom:
        return
    first, last = max(first, left), min(last, right)
    off_v = np.float32(abs(2 * i + 1 - top - bottom)) / np.float32(bottom - top)
    middle, scale = left + right - 1, np.float32(1) / np.float32(right - left)
    weight = np.float32(0)
    for j in range(first, last):
        weight += np.float32(1) - np.float32(RIM) * max(np.float32(abs(2 * j - middle)) * scale, off_v)
    sums[1] += max(0, last - first)
    sums[2] += weight


@numba.njit(cache=True, nogil=True)
def _add_colours(row, first_u, step, first, last, sums):  # type: ignore[no-untyped-def]
    red, green, blue = 0, 0, 0
    for j in range(first, last):
        pixel = row[first_u + j * step]
        red, green, blue = red + pixel[0], green + pixel[1], blue + pixel[2]
    sums[4], sums[5], sums[6] = sums[4] + red, sums[5] + green, sums[6] + blue


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _alike(sums, coloured):  # type: ignore[no-untyped-def]
    """(K, K) bool: whether the shares of red, green and blue of two parts are about the same."""
    count = len(sums) - 1
    share = np.empty((count, 3))
    alike = np.zeros((count, count), np.bool_)
    for k in range(count):
        dark = DARK * sums[k + 1, 0]
        whole = sums[k + 1, 4] + sums[k + 1, 5] + sums[k + 1, 6] + 3 * dark
        for c in range(3):
            share[k, c] = (sums[k + 1, 4 + c] + dark) / whole
    for k in range(count):
        for o in range(count):
            off = abs(share[k, 0] - share[o, 0]) + abs(share[k, 1] - share[o, 1]) + abs(share[k, 2] - share[o, 2])
            alike[k, o] = coloured and off < ALIKE
    return alike


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _compare(labels, depth, x, y, bounds, touching, front, gap):  # type: ignore[no-untyped-def]
    """Fill the tables of pairs from the cells next to each other."""
    h, w = labels.shape
    pairs = _find_pairs(labels, depth)
    for i in range(h):
        row = pairs[i]
        for j in range(w):
            bits = row[j]
            if bits == 0:
                continue
            jump = bounds[0] + bounds[1] * depth[i, j] * depth[i, j]
            for d in range(1, ACROSS + 1):
                if bits & 1:
                    _pair(labels, depth, x, y, i, j, i, j + d, d, jump, touching, front, gap)
                if bits & 2:
                    _pair(labels, depth, x, y, i, j, i + d, j, d, jump, touching, front, gap)
                bits >>= 2


@numba.njit(cache=True, nogil=True)
def _find_pairs(labels, depth):  # type: ignore[no-untyped-def]
    """(h, w) uint8: two bits for each distance d, whether a cell d to the right, or below, is of another part.

    Cells without depth are of no pair, nor are those of no part where the other one is farther than two cells."""
    h, w = labels.shape
    pairs = np.zeros((h, w), np.uint8)
    for i in range(h):
        here, z, out = labels[i], depth[i], pairs[i]
        for d in range(1, ACROSS + 1):
            right, down = np.uint8(1 << (2 * d - 2)), np.uint8(2 << (2 * d - 2))
            least = 0 if d <= 2 else 1
            other, far = here[d:], z[d:]
            for j in range(len(other)):
                known = (z[j] > 0) & (far[j] > 0) & (here[j] >= least) & (other[j] >= least)
                out[j] |= right if (here[j] != other[j]) & known else np.uint8(0)
            if i + d < h:
                other, far = labels[i + d], depth[i + d]
                for j in range(w):
                    known = (z[j] > 0) & (far[j] > 0) & (here[j] >= least) & (other[j] >= least)
                    out[j] |= down if (here[j] != other[j]) & known else np.uint8(0)
    return pairs


@numba.njit(cache=True, nogil=True, fastmath=EXACT, inline="always")
def _pair(labels, depth, x, y, i, j, p, q, d, jump, touching, front, gap):  # type: ignore[no-untyped-def]
    """Count one pair of cells of two parts, ``d`` cells from each other."""
    k, o = labels[i, j], labels[p, q]
    s, t = depth[i, j], depth[p, q]
    if k > 0 and o > 0:
        d_x, d_y, d_z = x[q] * t - x[j] * s, y[p] * t - y[i] * s, t - s
        square = d_x * d_x + d_y * d_y + d_z * d_z
        gap[k, o] = min(gap[k, o], square)
        gap[o, k] = gap[k, o]
    if d == 1 and abs(t - s) < jump:
        touching[k, o] += 1
        touching[o, k] += 1
    elif d <= 2 and t - s >= jump:
        front[k, o] += 1
    elif d <= 2 and s - t >= jump:
        front[o, k] += 1
