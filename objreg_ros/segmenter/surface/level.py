# SPDX-License-Identifier: Apache-2.0
"""What around a box is support surface: the cells within the noise of a level plane, fitted anew where the box is.

A depth camera bends planes by some millimetres over the frame, so only a local fit parts a thin book from its table.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import EXACT, Surface, Window
from objreg_ros.segmenter.surface.support import Ground, Plane, fit_level
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

OWN_TOP = 0.65  # a level part with more of it in a box is a top of the object there, not what it stands on
LOWEST = 0.1  # with less than this share of the cells in and around the box below it a level part is no top
MANY = 9000  # cells of which every third in each row and column is enough for a plane
MIN_NEAR = 12  # coarse cells of a part around a box that say something
REACH = 3  # coarse cells that a support surface is thought to go on
SPREADS = 2.0  # standard deviations of the surface's noise
MAX_SPREAD = 0.5  # tolerances; what is rougher is no plane


def support_cells(around: Surface, window: Window, ground: Ground, base: float) -> tuple[Array, bool]:
    """(h, w) bool: the cells of ``around`` that are support surfaces, and whether there is one.

    ``window`` is the box in cells of the whole frame, ``around`` a crop of it; ``base`` metres are added to the noise.
    """
    level = np.zeros(around.depth.shape, np.bool_)
    here = np.empty(around.depth.shape, np.bool_)
    found = False
    if ground.up is None:
        return level, found
    grid = (around.depth, around.x, around.y, (around.left, around.top, around.step))
    for support in ground.supports:
        normal, offset = _equation(support.plane)
        if not _find_beneath(support.parts, support.total, normal, offset, window, grid, ground.coarse.step, here):
            continue
        stride = 2 if here.size <= MANY else 3
        plane = fit_level(around, here, ground.up, support.plane, stride, lowest=True)
        if plane is None or plane.spread > MAX_SPREAD:
            plane = support.plane
        limit = np.float32(SPREADS * min(plane.spread, MAX_SPREAD))
        _mark(around.depth, around.x, around.y, here, *_equation(plane), np.float32(base), limit, level)
        found = True
    return level, found


def _equation(plane: Plane) -> tuple[Array, np.float32]:
    return plane.normal.astype(np.float32), np.float32(plane.offset)


@numba.njit(cache=True, nogil=True)
def _find_beneath(parts, total, normal, offset, window, grid, coarse_step, here):  # type: ignore[no-untyped-def]
    """Fill ``here``: where a support may be what the objects in ``window`` stand on; whether it is anywhere.

    A part that lies mostly in the window is a top of the object itself, unless more of its plane is seen around it, or
    nothing is seen below it.
    """
    depth, _, _, (first_u, first_v, step) = grid
    h, w = depth.shape
    left, top = first_u // coarse_step, first_v // coarse_step
    stride = coarse_step // step  # 1 or more
    crop = (left, top, left + -(-(w + stride) // stride), top + -(-(h + stride) // stride))
    near = _count(parts, crop, 1, len(total))
    within = _count(parts, window, stride, len(total))
    around_it, on_it = 0, 0
    for k in range(1, len(total)):
        if within[k] > OWN_TOP * total[k]:
            on_it += near[k]
        else:
            around_it += near[k]
    if around_it + on_it < MIN_NEAR:
        return False
    is_top = on_it > 0 and around_it <= on_it and _share_below(normal, offset, grid) > LOWEST
    kept, some = np.zeros(len(total), np.bool_), False
    for k in range(1, len(total)):
        kept[k] = near[k] >= MIN_NEAR and not (is_top and within[k] > OWN_TOP * total[k])
        some |= kept[k]
    if some:
        _spread(parts, kept, crop, coarse_step, grid, here)
    return some


@numba.njit(cache=True, nogil=True)
def _count(parts, window, stride, count):  # type: ignore[no-untyped-def]
    """(count,) how many cells each part has in a window of cells ``stride`` times as fine; none for 0."""
    near = np.zeros(count, np.int64)
    for i in range(-(-window[1] // stride), min(-(-window[3] // stride), parts.shape[0])):
        for j in range(-(-window[0] // stride), min(-(-window[2] // stride), parts.shape[1])):
            near[parts[i, j]] += 1
    near[0] = 0
    return near


@numba.njit(cache=True, nogil=True)
def _spread(parts, kept, crop, coarse_step, grid, here):  # type: ignore[no-untyped-def]
    """Fill ``here``: the cells with depth no farther than REACH coarse cells from a kept part, along both axes."""
    depth, _, _, (first_u, first_v, step) = grid
    left, top, right, bottom = crop[0], crop[1], min(crop[2], parts.shape[1]), min(crop[3], parts.shape[0])
    mask = np.zeros((bottom - top, right - left), np.bool_)
    for i in range(top, bottom):
        free_from = 0  # the first column that is not marked by what was met before
        for j in range(left, right):
            if kept[parts[i, j]]:
                for k in range(max(free_from, j - left - REACH), min(right - left, j - left + REACH + 1)):
                    mask[i - top, k] = True
                free_from = j - left + REACH + 1
    h, w = mask.shape
    cols = np.empty(depth.shape[1], np.int32)
    for j in range(len(cols)):
        cols[j] = min((first_u + step * j) // coarse_step - left, w - 1)
    marks, now = np.empty(w, np.bool_), -1
    for i in range(depth.shape[0]):
        middle = min((first_v + i * step) // coarse_step - top, h - 1)
        if middle != now:
            _any_row(mask, max(0, middle - REACH), min(h, middle + REACH + 1), marks)
            now = middle
        row, out = depth[i], here[i]
        for j in range(len(row)):
            out[j] = marks[cols[j]] & (row[j] > 0)


@numba.njit(cache=True, nogil=True)
def _any_row(mask, first, end, marks):  # type: ignore[no-untyped-def]
    """Fill ``marks (w,)``: the columns that are marked in any of the rows first … end."""
    for j in range(len(marks)):
        marks[j] = False
    for i in range(first, end):
        row = mask[i]
        for j in range(len(row)):
            marks[j] |= row[j]


@numba.njit(cache=True, nogil=True)
def _share_below(normal, offset, grid):  # type: ignore[no-untyped-def]
    """The share of the cells that lie well below a plane; around a tight box there are some where in it are none."""
    depth, x, y, _ = grid
    known, below = 0, 0
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            if z > 0:
                known += 1
                below += z * (normal[0] * x[j] + normal[1] * y[i] + normal[2]) + offset < -(
                    PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z
                )
    return below / max(1, known)


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _mark(depth, x, y, here, n, offset, base, limit, level):  # type: ignore[no-untyped-def]
    """Mark the cells within base + limit · tolerance of the plane."""
    for i in range(depth.shape[0]):
        row, possible, out = depth[i], here[i], level[i]
        for j in range(len(row)):
            z = row[j]
            height = z * (n[0] * x[j] + n[1] * y[i] + n[2]) + offset
            out[j] |= possible[j] & (abs(height) < base + limit * (PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z))
