# SPDX-License-Identifier: Apache-2.0
"""One object out of its box: what stands on the support, in one piece, most of it in the box."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data import Array, DepthImage, PointFlag
from objreg_ros.segmenter.boxes import Box, expanded
from objreg_ros.segmenter.components import Parts, connect, grow, measure
from objreg_ros.segmenter.creases import find_creases, find_steps
from objreg_ros.segmenter.extract import Pixels, extract
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.selection import Window, select
from objreg_ros.segmenter.support import Ground, fit_plane, tolerance
from objreg_ros.segmenter.surface import Surface, reduce

FINE = 2  # pixels per cell around a box
LEVEL = np.cos(np.radians(15.0))  # a cell near the support's height that is tilted more than this is of the object
BUMP = 0.5
GROWTH = 8  # rounds that parts grow over valleys
MAX_PARTS = 24
OWN_TOP = 0.65  # a level part with more of it in the box is a top of the object, not what it stands on
LEAK = 0.08  # an object with more of it outside its box is cut by the box
NEAR_BORDER = 0.012  # of the image's size


def isolate(image: DepthImage, box: Box, ground: Ground, params: SegmenterParams) -> tuple[Pixels, PointFlag]:
    """The pixels of the object that ``box`` shows, and the flags that hold for all of them.

    ``box`` must not be empty. No pixel outside the box comes back; no object gives no pixels.
    """
    height, width = image.depth.shape
    z_max, y_max = params.limits
    jump = (params.jump, params.jump_z2)
    step = FINE if min(box[2] - box[0], box[3] - box[1]) >= 8 * FINE else 1
    around = expanded(box, params.margin, step, height, width)
    surface = reduce(image.depth, image.intrinsics, around, step, (params.z_min, z_max, y_max), jump)
    valley = find_creases(surface, params.crease, jump)
    level, supported = _support_cells(surface, valley, box, ground, params.height)
    window = _cells_of(box, surface)
    parts = _parts(surface, (surface.depth > 0) & ~level, valley, window, jump)
    selected = select(parts, window)
    chosen = np.isin(parts.labels, selected) if selected else np.zeros_like(level)
    pixels = extract(image, box, surface, chosen, jump)
    flags = PointFlag(0) if supported else PointFlag.UNSUPPORTED
    index = np.array(selected, int) - 1
    if selected and parts.inside[index].sum() < (1 - LEAK) * parts.total[index].sum():
        flags |= PointFlag.CUT_BY_BOX
    if _touches_border(pixels, height, width):
        flags |= PointFlag.CUT_BY_IMAGE
    if _wall_like(surface, chosen, window):
        flags |= PointFlag.WALL_LIKE
    return pixels, flags


def _parts(surface: Surface, keep: Array, valley: Array, window: Window, jump: tuple[float, float]) -> Parts:
    """The parts of the ``keep`` cells, cut at depth jumps and valleys."""
    steps = find_steps(surface.depth, BUMP, jump)
    labels, count = connect(surface.depth, keep & ~valley & ~steps, jump)
    grow(labels, surface.depth, keep, jump, GROWTH)
    return measure(labels, count, window, surface.depth, jump, MAX_PARTS)


def _cells_of(box: Box, surface: Surface) -> Window:
    """The cells of ``surface`` whose middle lies in ``box``: left, top, right, bottom; at least one cell."""
    h, w = surface.depth.shape
    step = surface.step
    left, right = (round((u - surface.left) / step) for u in (box[0], box[2]))
    top, bottom = (round((v - surface.top) / step) for v in (box[1], box[3]))
    left, top = min(left, w - 1), min(top, h - 1)
    return left, top, max(left + 1, min(right, w)), max(top + 1, min(bottom, h))


def _support_cells(surface: Surface, valley: Array, box: Box, ground: Ground, base: float) -> tuple[Array, bool]:
    """The cells of the support surfaces here, and whether there is one."""
    level = np.zeros(surface.depth.shape, bool)
    up = ground.up
    if up is None:
        return level, False
    rows, cols = _coarse_index(surface, ground.surface)
    coarse_box = _window(box, ground.surface)
    cosine = surface.normals @ up.astype(np.float32)
    known = surface.depth > 0
    points = surface.points
    loose = tolerance(surface.depth)
    found = False
    for support in ground.supports:
        here = (support.parts > 0) & ~support.parts_within(coarse_box, OWN_TOP)
        here = cv2.dilate(here.view(np.uint8), np.ones((7, 7), np.uint8))[np.ix_(rows, cols)] > 0
        near = known & here & (cosine > 0.9) & (np.abs(support.plane.height(points)) < 2 * loose)
        if np.count_nonzero(near) < 40:
            continue
        plane = fit_plane(points[near], up)
        if plane is None:
            continue
        height = plane.height(points)
        spread = 1.48 * float(np.median(np.abs(height[near]) / loose[near]))
        tight = np.minimum(base + 2.5 * spread * loose, loose)
        level |= known & here & ((np.abs(height) < tight) | (~valley & (cosine > LEVEL) & (np.abs(height) < loose)))
        found = True
    return level, found


def _coarse_index(fine: Surface, coarse: Surface) -> tuple[Array, Array]:
    """The rows and columns of ``coarse`` that the rows and columns of ``fine`` lie in."""
    h, w = fine.depth.shape
    rows = (fine.top + np.arange(h) * fine.step - coarse.top) // coarse.step
    cols = (fine.left + np.arange(w) * fine.step - coarse.left) // coarse.step
    return np.minimum(rows, coarse.depth.shape[0] - 1), np.minimum(cols, coarse.depth.shape[1] - 1)


def _window(box: Box, coarse: Surface) -> tuple[slice, slice]:
    """The cells of ``coarse`` that ``box`` touches."""
    x0, y0, x1, y1 = box
    return slice(y0 // coarse.step, -(-y1 // coarse.step)), slice(x0 // coarse.step, -(-x1 // coarse.step))


def _choose(labels: Array, count: int, inside: Array) -> tuple[int, PointFlag]:
    """The label of the part with most of the box's middle; 0 if there is none. And whether the box cuts it."""
    if count == 0 or not inside.any():
        return 0, PointFlag(0)
    rows, cols = np.nonzero(inside)
    v = np.abs(rows - rows.mean()) / max(1.0, np.ptp(rows) / 2)
    u = np.abs(cols - cols.mean()) / max(1.0, np.ptp(cols) / 2)
    here = labels[inside]
    weight = np.bincount(here, weights=1.0 - 0.7 * np.maximum(u, v), minlength=count + 1)
    total = np.bincount(labels.ravel(), minlength=count + 1)
    share = np.bincount(here, minlength=count + 1) / np.maximum(total, 1)
    weight[0] = 0
    best = int((weight * share).argmax())
    if weight[best] <= 0:
        return 0, PointFlag(0)
    return best, PointFlag.CUT_BY_BOX if share[best] < 1 - LEAK else PointFlag(0)


def _touches_border(pixels: Pixels, height: int, width: int) -> bool:
    if len(pixels) == 0:
        return False
    low, high = pixels.uv.min(axis=0), pixels.uv.max(axis=0)
    du, dv = max(1, round(NEAR_BORDER * width)), max(1, round(NEAR_BORDER * height))
    return bool(low[0] < du or low[1] < dv or high[0] >= width - du or high[1] >= height - dv)


def _wall_like(surface: Surface, chosen: Array, window: Window) -> bool:
    """Whether the chosen cells are flat and their plane goes on around the box."""
    points = surface.points
    patch = points[chosen].astype(np.float64)
    if len(patch) < 50:
        return False
    centre = patch.mean(axis=0)
    normal = np.linalg.eigh((patch - centre).T @ (patch - centre))[1][:, 0]
    on_plane = (surface.depth > 0) & (np.abs((points - centre) @ normal) < 2 * tolerance(surface.depth))
    ring = surface.depth > 0
    ring[window[1] : window[3], window[0] : window[2]] = False
    if np.count_nonzero(ring) < 50:
        return False
    return bool(on_plane[chosen].mean() > 0.85 and on_plane[ring].mean() > 0.4)
