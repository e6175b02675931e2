# SPDX-License-Identifier: Apache-2.0
"""One object out of its box: what stands on the support, in the parts that the box asks for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects import paper
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.objects.extract import Pixels, colours, extract
from objreg_ros.segmenter.objects.flags import whole_flags
from objreg_ros.segmenter.objects.selection import select
from objreg_ros.segmenter.objects.targets import Outline, Target
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.surface.cells import Surface, Window
from objreg_ros.segmenter.surface.components import split
from objreg_ros.segmenter.surface.holes import fill_holes
from objreg_ros.segmenter.surface.level import support_cells
from objreg_ros.segmenter.surface.parts import measure
from objreg_ros.segmenter.surface.seams import find_seams
from objreg_ros.segmenter.surface.support import Ground

MIN_PART = 10  # cells; what is smaller joins a neighbour
GROWTH = 12  # rounds that parts grow over seams
MAX_CELLS = 9000  # around a box; larger ones are looked at on the coarse grid
MAX_PARTS = 32


class Isolated(NamedTuple):
    """What a box shows: ``pixels``, the ``flags`` that hold for all of them, and the ``cells`` of the whole frame that
    they are in; None where the method knows none."""

    pixels: Pixels
    flags: PointFlag
    cells: Cells | None


class Cells(NamedTuple):
    """``chosen (h, w) bool`` of the cells of ``window`` of the grid with ``step`` pixels a cell."""

    chosen: Array
    window: Window
    step: int


def isolate_target(image: DepthImage, target: Target, ground: Ground, params: SegmenterParams) -> Isolated:
    """The object that a detection shows: by its mask, by the founding filter, or by what stands in its box."""
    if target.outline is not None:
        return cut_out(image, target.box, target.outline, ground, params)
    if params.preset == "paper":
        return Isolated(paper.cut(image, target.box, params), PointFlag(0), None)
    return isolate(image, target.box, ground, params)


def isolate(image: DepthImage, box: Box, ground: Ground, params: SegmenterParams) -> Isolated:
    """The object that ``box``, which must not be empty, shows: no pixel outside it, and none for no object."""
    jump = params.jump_bounds
    grid = _grid(box, ground, params.margin)
    window = _cells(box, grid)
    crop = _expanded(window, params.margin, grid)
    around = grid.crop(crop)
    level, supported = support_cells(around, window, ground, params.height)
    here = (window[0] - crop[0], window[1] - crop[1], window[2] - crop[0], window[3] - crop[1])
    labels, count = split(around.depth, level, find_seams(around, params.crease, jump), jump, MIN_PART, GROWTH)
    parts = measure(labels, count, here, around, colours(image), jump, MAX_PARTS)
    chosen = select(parts, here)
    fill_holes(chosen, around.depth, jump)
    pixels = extract(image, box, around, chosen, jump)
    flags = PointFlag(0) if supported else PointFlag.UNSUPPORTED
    flags |= whole_flags(image, pixels, around, chosen, here)
    return Isolated(pixels, flags, Cells(chosen, crop, grid.step))


def cut_out(image: DepthImage, box: Box, mask: Outline, ground: Ground, params: SegmenterParams) -> Isolated:
    """What ``mask`` of the picture covers within ``box``, taken as it is but for what is not measured.

    A pixel belongs to the mask by its cell, and by its depth: what the mask's edge takes of the background is left out
    as far as it is another cell's.
    """
    jump = params.jump_bounds
    grid = _grid(box, ground, params.margin)
    crop = _expanded(_cells(box, grid), params.margin, grid)
    around, (left, top, right, bottom) = grid.crop(crop), crop
    rows, columns = (
        np.minimum(np.arange(first, end) * grid.step + grid.step // 2, size - 1)
        for first, end, size in zip((top, left), (bottom, right), mask.numbers.shape, strict=True)
    )
    chosen = (mask.numbers[np.ix_(rows, columns)] == mask.own) & (around.depth > 0)
    pixels = extract(image, box, around, chosen, jump)
    flags = whole_flags(image, pixels, around, chosen, (0, 0, right - left, bottom - top))
    return Isolated(pixels, flags, Cells(chosen, crop, grid.step))


def taken_cells(found: Iterable[Isolated], ground: Ground) -> Array:
    """The cells (h, w) bool of the whole frame that are of what was found in boxes."""
    taken = np.zeros(ground.surface.depth.shape, np.bool_)
    for cells in (one.cells for one in found if one.cells is not None):
        scale = cells.step // ground.surface.step
        left, top, right, bottom = cells.window
        taken[::scale, ::scale][top:bottom, left:right] |= cells.chosen
    return taken


def _grid(box: Box, ground: Ground, margin: float) -> Surface:
    """The grid of the frame on which a box has no more than MAX_CELLS with its margin, or the coarsest one."""
    pixels = (box[2] - box[0]) * (box[3] - box[1]) * (1 + 2 * margin) ** 2
    return ground.surface if pixels <= MAX_CELLS * ground.surface.step**2 else ground.coarse


def _cells(box: Box, surface: Surface) -> Window:
    """The cells of the whole frame whose middle lies in ``box``; at least one cell."""
    h, w = surface.depth.shape
    left, top, right, bottom = (round(edge / surface.step) for edge in box)
    left, top = min(left, w - 1), min(top, h - 1)
    return left, top, max(left + 1, min(right, w)), max(top + 1, min(bottom, h))


def _expanded(window: Window, margin: float, surface: Surface) -> Window:
    """``window`` with ``margin`` of its size around it, and at least four cells, within the frame."""
    h, w = surface.depth.shape
    dx, dy = int(margin * (window[2] - window[0])) + 4, int(margin * (window[3] - window[1])) + 4
    return max(0, window[0] - dx), max(0, window[1] - dy), min(w, window[2] + dx), min(h, window[3] + dy)
