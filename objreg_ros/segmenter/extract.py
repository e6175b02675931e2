# SPDX-License-Identifier: Apache-2.0
"""From chosen cells back to full resolution: the pixels of an object with points, normals and edge flags."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array, DepthImage, PointFlag
from objreg_ros.segmenter.boxes import Box
from objreg_ros.segmenter.surface import EXACT, Surface

EDGE = int(PointFlag.EDGE)
MIN_NEIGHBOURS = 3  # of 8; a pixel with fewer in its object is an outlier


@dataclass(frozen=True, slots=True)
class Pixels:
    """M pixels of one object: ``uv (M, 2) int32``, ``xyz`` and ``normals (M, 3) float32``, ``edge (M,) uint16`` flags
    and the ``area`` of surface that they measure in m²."""

    uv: Array
    xyz: Array
    normals: Array
    edge: Array
    area: float

    def __len__(self) -> int:
        return len(self.uv)


def extract(image: DepthImage, box: Box, surface: Surface, chosen: Array, jump: tuple[float, float]) -> Pixels:
    """The pixels of ``box`` whose surface is a ``chosen (h, w) bool`` cell of ``surface``."""
    x0, y0, x1, y1 = box
    camera = image.intrinsics
    mask = np.zeros((y1 - y0, x1 - x0), np.bool_)
    count = _mark(image.depth, x0, y0, surface.depth, surface.left, surface.top, surface.step, chosen, *jump, mask)
    uv, edge = np.empty((count, 2), np.int32), np.empty(count, np.uint16)
    xyz, normals = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    grid = (surface.left, surface.top, surface.step)
    n, area = _gather(image.depth, x0, y0, mask, surface.normals, grid, lens, *jump, uv, xyz, normals, edge)
    return Pixels(uv[:n], xyz[:n], normals[:n], edge[:n], float(area))


@numba.njit(cache=True, fastmath=EXACT)
def _mark(depth, x0, y0, cells, left, top, step, chosen, a, b, mask):  # type: ignore[no-untyped-def]
    """Mark the pixels that belong to chosen cells: by their own cell, or by the nearest in depth around it."""
    h, w = cells.shape
    count = 0
    for v in range(mask.shape[0]):
        i = min((v + y0 - top) // step, h - 1)
        for u in range(mask.shape[1]):
            z = depth[v + y0, u + x0]
            j = min((u + x0 - left) // step, w - 1)
            jump = a + b * z * z
            if not (z > 0):
                continue
            if cells[i, j] > 0 and abs(cells[i, j] - z) < jump:
                mask[v, u] = chosen[i, j]
            else:
                nearest = jump
                for p in range(max(0, i - 1), min(h, i + 2)):
                    for q in range(max(0, j - 1), min(w, j + 2)):
                        if cells[p, q] > 0 and abs(cells[p, q] - z) < nearest:
                            nearest = abs(cells[p, q] - z)
                            mask[v, u] = chosen[p, q]
            count += mask[v, u]
    return count


@numba.njit(cache=True, fastmath=EXACT)
def _gather(depth, x0, y0, mask, cell_normals, grid, lens, a, b, uv, xyz, normals, edge):  # type: ignore[no-untyped-def]
    """Fill the outputs from the marked pixels that are no outliers; their number and the area that they measure."""
    h, w = mask.shape
    left, top, step = grid
    area = 0.0
    n = 0
    for v in range(h):
        i = min((v + y0 - top) // step, cell_normals.shape[1] - 1)
        y = (v + y0 - lens[3]) / lens[1]
        for u in range(w):
            if not mask[v, u] or _neighbours(mask, v, u) < MIN_NEIGHBOURS:
                continue
            z = depth[v + y0, u + x0]
            x = (u + x0 - lens[2]) / lens[0]
            j = min((u + x0 - left) // step, cell_normals.shape[2] - 1)
            uv[n, 0], uv[n, 1] = u + x0, v + y0
            xyz[n, 0], xyz[n, 1], xyz[n, 2] = x * z, y * z, z
            for k in range(3):
                normals[n, k] = cell_normals[k, i, j]
            edge[n] = EDGE if _at_jump(depth, v + y0, u + x0, a + b * z * z) else 0
            cosine = abs(x * normals[n, 0] + y * normals[n, 1] + normals[n, 2])
            area += z * z / (lens[0] * lens[1] * (max(cosine, 0.1) if cosine > 0 else 0.7))
            n += 1
    return n, area


@numba.njit(cache=True, inline="always")
def _neighbours(mask, v, u):  # type: ignore[no-untyped-def]
    count = -1
    for p in range(max(0, v - 1), min(mask.shape[0], v + 2)):
        for q in range(max(0, u - 1), min(mask.shape[1], u + 2)):
            count += mask[p, q]
    return count


@numba.njit(cache=True, fastmath=EXACT, inline="always")
def _at_jump(depth, v, u, jump):  # type: ignore[no-untyped-def]
    """Whether a pixel two rows or columns away has no depth or lies across a depth jump."""
    z = depth[v, u]
    for k in range(4):
        p = v + (2 if k == 0 else -2 if k == 1 else 0)
        q = u + (2 if k == 2 else -2 if k == 3 else 0)
        if p < 0 or q < 0 or p >= depth.shape[0] or q >= depth.shape[1]:
            continue
        if not (abs(depth[p, q] - z) < 2 * jump):
            return True
    return False
