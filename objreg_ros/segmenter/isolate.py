# SPDX-License-Identifier: Apache-2.0
"""One object out of its box: what stands on the support, in the parts that the box asks for."""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, DepthImage, PointFlag
from objreg_ros.segmenter.boxes import Box
from objreg_ros.segmenter.components import connect, grow
from objreg_ros.segmenter.extract import Pixels, extract
from objreg_ros.segmenter.holes import fill_holes
from objreg_ros.segmenter.level import support_cells
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.parts import Parts, measure
from objreg_ros.segmenter.seams import find_seams
from objreg_ros.segmenter.selection import select
from objreg_ros.segmenter.support import Ground, tolerance
from objreg_ros.segmenter.surface import Surface, Window

MIN_PART = 10  # cells; what is smaller joins a neighbour
GROWTH = 12  # rounds that parts grow over seams
MAX_PARTS = 32
LEAK = 0.08  # an object with more of it outside its box is cut by the box
NEAR_BORDER = 0.012  # of the image's size
FLAT = 0.85  # share of a wall-like object's cells on one plane
WALL_AROUND = 0.4  # share of the cells around it on the same plane


def isolate(image: DepthImage, box: Box, ground: Ground, params: SegmenterParams) -> tuple[Pixels, PointFlag]:
    """The pixels of the object that ``box`` shows, and the flags that hold for all of them.

    ``box`` must not be empty. No pixel outside the box comes back; no object gives no pixels.
    """
    jump = (params.jump, params.jump_z2)
    window = _cells(box, ground.surface)
    crop = _expanded(window, params.margin, ground.surface)
    around = ground.surface.crop(crop)
    level, supported = support_cells(around, window, ground, params.height)
    here = (window[0] - crop[0], window[1] - crop[1], window[2] - crop[0], window[3] - crop[1])
    keep = (around.depth > 0) & ~level
    labels, count = connect(around.depth, keep & ~find_seams(around, params.crease, jump), jump)
    labels[np.bincount(labels.ravel(), minlength=count + 1)[labels] < MIN_PART] = 0
    grow(labels, around.depth, keep, jump, GROWTH)
    parts = measure(labels, count, here, around, image.rgb, jump, MAX_PARTS)
    selected = select(parts, here)
    chosen = _chosen(parts, selected)
    fill_holes(chosen, around.depth, jump)
    pixels = extract(image, box, around, chosen, jump)
    flags = PointFlag(0) if supported else PointFlag.UNSUPPORTED
    flags |= _flags(image, pixels, around, chosen, here)
    return pixels, flags


def _chosen(parts: Parts, selected: list[int]) -> Array:
    """(h, w) bool: the cells of the parts with these numbers."""
    table = np.zeros(len(parts) + 1, np.bool_)
    table[selected] = True
    return table[parts.labels]


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


def _flags(image: DepthImage, pixels: Pixels, around: Surface, chosen: Array, here: Window) -> PointFlag:
    """What else is known of a whole object."""
    flags = PointFlag(0)
    inside = np.count_nonzero(chosen[here[1] : here[3], here[0] : here[2]])
    if inside < (1 - LEAK) * np.count_nonzero(chosen):
        flags |= PointFlag.CUT_BY_BOX
    if _touches_border(pixels, *image.depth.shape):
        flags |= PointFlag.CUT_BY_IMAGE
    if _wall_like(around, chosen, here):
        flags |= PointFlag.WALL_LIKE
    return flags


def _touches_border(pixels: Pixels, height: int, width: int) -> bool:
    if len(pixels) == 0:
        return False
    low, high = pixels.uv.min(axis=0), pixels.uv.max(axis=0)
    du, dv = max(1, round(NEAR_BORDER * width)), max(1, round(NEAR_BORDER * height))
    return bool(low[0] < du or low[1] < dv or high[0] >= width - du or high[1] >= height - dv)


def _wall_like(around: Surface, chosen: Array, here: Window) -> bool:
    """Whether the chosen cells are flat and their plane goes on around the box."""
    points = around.points[::2, ::2]
    patch = points[chosen[::2, ::2]].astype(np.float64)
    known = around.depth[::2, ::2] > 0
    ring = known.copy()
    ring[here[1] // 2 : -(-here[3] // 2), here[0] // 2 : -(-here[2] // 2)] = False
    if len(patch) < 30 or np.count_nonzero(ring) < 30:
        return False
    centre = patch.mean(axis=0)
    normal = np.linalg.eigh((patch - centre).T @ (patch - centre))[1][:, 0].astype(np.float32)
    off = np.abs(points @ normal - centre.astype(np.float32) @ normal)
    on_plane = known & (off < 2 * tolerance(around.depth[::2, ::2]))
    return bool(on_plane[chosen[::2, ::2]].mean() > FLAT and on_plane[ring].mean() > WALL_AROUND)
