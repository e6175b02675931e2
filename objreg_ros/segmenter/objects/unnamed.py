# SPDX-License-Identifier: Apache-2.0
"""Objects without a name: what stands on a support or apart from everything, whatever the detector says.

The cells that are of no support are connected as they are. A component that is no object as a whole is parted at its
seams. An object has the size of one, and its border is its own: behind most of it the picture falls back, or it stands
on a support there. Occluded pieces, and those that go on without a step or leave the picture, are of something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.native import kernels
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.objects.extract import Pixels, extract
from objreg_ros.segmenter.objects.flags import whole_flags
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.surface.cells import MIN_COSINE, Surface, Window
from objreg_ros.segmenter.surface.components import connect, split
from objreg_ros.segmenter.surface.seams import find_seams
from objreg_ros.segmenter.surface.support import Ground
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

_KERNELS = kernels("unnamed")
MOST = 6  # unnamed objects of a frame
TOLERANCE = PLANE_TOLERANCE_M, PLANE_TOLERANCE_GROWTH
LEAST_CELLS = 20  # of the coarse grid
GROWTH = 3  # rounds that parts grow over seams
LEAST_SIZE, MOST_SIZE = 0.04, 1.0  # m: the longest side of an object
LEAST_WIDTH = 0.02  # m: 4 × cells / border, the side of a square as ragged
LEAST_WIDTH_CELLS = 3.0
LEAST_FILL = 0.35  # of the box around it
LEAST_RISE = 1.0  # tolerances of a plane that an object rises above its support, on average
OWN = 0.7  # share of the border that is the object's own
MOST_OUTSIDE = 0.15  # share of the border at the picture's
MOST_TAKEN = 0.1  # share that is of a named object
MOST_PERSON = 0.5  # share within the box of a person
BESIDE = 6  # cells around an object that are compared to find a patch of a wall
SUMS = 12  # and their columns, as the kernel has them
CELLS, DEPTH, TAKEN, SHOWN, HIDDEN, GOES_ON, OUTSIDE, STANDS, UNKNOWN, HEIGHT, BASE, BASES = range(SUMS)


class UnnamedPixels(NamedTuple):
    """An unnamed object: its ``pixels``, the ``flags`` of all of them, and which share of its border is its ``own``."""

    pixels: Pixels
    flags: PointFlag
    own: float


class _Surroundings(NamedTuple):
    """The surroundings of parts: cells (h, w) bool of supports and of named objects, and persons' boxes."""

    level: Array
    taken: Array
    people: Sequence[Box]


class Part(NamedTuple):
    """A part that is an object: ``chosen (h, w) bool`` of the cells of ``extent``, and which share of its border is its
    ``own``; ``stands`` whether it was seen to stand on a support."""

    chosen: Array
    extent: Window
    own: float
    stands: bool


def find_unnamed(
    image: DepthImage, ground: Ground, taken: Array, people: Sequence[Box], params: SegmenterParams
) -> list[UnnamedPixels]:
    """At most MOST unnamed objects, the most certain first; none where the parameters ask for none.

    ``taken (h, w) bool`` are the cells of the whole frame that are of a named object, ``people`` the boxes of persons
    in pixels of the image.
    """
    if not params.unnamed or params.preset == "paper":
        return []
    grid, jump = ground.coarse, params.jump_bounds
    scale = grid.step // ground.surface.step
    taken = np.ascontiguousarray(taken[::scale, ::scale])
    level = _level(ground)
    whole, count = connect(grid.depth, (grid.depth > 0) & ~level, jump)
    around = _Surroundings(level, taken, people)
    found = _unnamed(whole, count, around, ground, jump)
    done = level.copy()
    for one in found:  # what is an object as a whole is not parted
        left, top, right, bottom = one.extent
        done[top:bottom, left:right] |= one.chosen
    parts, count = split(grid.depth, done, find_seams(grid, params.crease, jump), jump, LEAST_CELLS, GROWTH)
    found += _unnamed(parts, count, around, ground, jump)
    found.sort(key=lambda one: -one.own * np.sqrt(one.chosen.sum()))
    placed = (_cut(image, grid, one, params) for one in found[: 2 * MOST])
    return [thing for thing in placed if thing is not None][:MOST]


def _level(ground: Ground) -> Array:
    """(h, w) bool of the coarse grid: the cells that are of a support, or near enough to one and on its plane.

    Its small parts may be the tops of objects.
    """
    level = np.zeros(ground.coarse.depth.shape, np.bool_)
    for support in ground.supports:
        _KERNELS.mark_level(
            ground.coarse.depth, ground.coarse.x, ground.coarse.y, support.parts, len(support.total),
            support.plane.normal.astype(np.float32), support.plane.offset, TOLERANCE, MIN_COSINE, level,
        )  # fmt: skip
    return level


def _unnamed(labels: Array, count: int, around: _Surroundings, ground: Ground, jump: tuple[float, float]) -> list[Part]:
    """Those of the parts 1 … ``count`` of ``labels (h, w)`` that are objects."""
    grid = ground.coarse
    up = np.zeros(3, np.float32) if ground.up is None else ground.up.astype(np.float32)
    sums, extent = np.zeros((count + 1, SUMS)), np.zeros((count + 1, 4), np.int64)
    reach = np.zeros((count + 1, 2))
    _KERNELS.survey(labels, around.level, around.taken, grid.depth, grid.x, grid.y, up, jump, sums, extent, reach)
    cells = np.maximum(sums[:, CELLS], 1)
    z = sums[:, DEPTH] / cells
    pitch = z * np.float64(grid.x[1] - grid.x[0] if len(grid.x) > 1 else 1.0)
    border = np.maximum(sums[:, SHOWN : UNKNOWN + 1].sum(axis=1), 1)
    own = (sums[:, SHOWN] + sums[:, STANDS] + 0.5 * sums[:, UNKNOWN]) / border
    width = 4 * cells / border
    sides = np.stack([extent[:, 2] - extent[:, 0], extent[:, 3] - extent[:, 1]], axis=1)
    longest = np.maximum(sides.max(axis=1) * pitch, reach[:, 1] - reach[:, 0])
    rise = np.where(sums[:, BASES] > 0, sums[:, HEIGHT] / cells - sums[:, BASE] / np.maximum(sums[:, BASES], 1), np.inf)
    thing = (cells >= LEAST_CELLS) & (own >= OWN) & (sums[:, OUTSIDE] <= MOST_OUTSIDE * border)
    thing &= (longest >= LEAST_SIZE) & (longest <= MOST_SIZE)
    thing &= (width >= LEAST_WIDTH_CELLS) & (width * pitch >= LEAST_WIDTH)
    thing &= cells >= LEAST_FILL * sides.prod(axis=1)
    thing &= sums[:, TAKEN] <= MOST_TAKEN * cells
    thing &= rise >= LEAST_RISE * (PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z)
    thing[0] = False
    parts = []
    for k in np.flatnonzero(thing).tolist():
        left, top, right, bottom = extent[k].tolist()
        chosen = labels[top:bottom, left:right] == k
        if not any(_is_within(chosen, left, top, box, grid.step) for box in around.people):
            parts.append(Part(chosen, (left, top, right, bottom), float(own[k]), bool(sums[k, BASES] > 0)))
    return parts


def _is_within(chosen: Array, left: int, top: int, box: Box, step: int) -> bool:
    """Whether most of the ``chosen`` cells, the first of them at ``left``, ``top``, lie in the ``box`` of a person."""
    u0, v0, u1, v1 = (round(edge / step) for edge in box)
    inside = chosen[max(0, v0 - top) : max(0, v1 - top), max(0, u0 - left) : max(0, u1 - left)]
    return bool(inside.sum() > MOST_PERSON * chosen.sum())


def _cut(image: DepthImage, grid: Surface, one: Part, params: SegmenterParams) -> UnnamedPixels | None:
    """The pixels of a part; None for a patch of a wall and for too few."""
    (h, w), (left, top, right, bottom) = grid.depth.shape, one.extent
    window = max(0, left - BESIDE), max(0, top - BESIDE), min(w, right + BESIDE), min(h, bottom + BESIDE)
    around, here = grid.crop(window), (left - window[0], top - window[1], right - window[0], bottom - window[1])
    chosen = np.zeros(around.depth.shape, np.bool_)
    chosen[here[1] : here[3], here[0] : here[2]] = one.chosen
    height, width = image.depth.shape
    first = max(0, (left - 1) * grid.step), max(0, (top - 1) * grid.step)
    box = (*first, min(width, (right + 1) * grid.step), min(height, (bottom + 1) * grid.step))
    pixels = extract(image, box, around, chosen, params.jump_bounds)
    flags = whole_flags(image, pixels, around, chosen, here)
    if len(pixels) < params.min_points or flags & PointFlag.WALL_LIKE:
        return None
    return UnnamedPixels(pixels, flags if one.stands else flags | PointFlag.UNSUPPORTED, one.own)
