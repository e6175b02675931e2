# SPDX-License-Identifier: Apache-2.0
"""From chosen cells back to full resolution: the pixels of an object with points, normals and edge flags."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array, DepthImage, PointFlag
from objreg_ros.segmenter.boxes import Box
from objreg_ros.segmenter.surface import EXACT, MIN_COSINE, Surface

EDGE = int(PointFlag.EDGE)
UNKNOWN_COSINE = np.float32(0.7)  # of a surface whose normal is not known
MIN_NEIGHBOURS = 3  # of 8; a pixel with fewer in its object is an outlier


@dataclass(frozen=True, slots=True)
class Pixels:
    """M pixels of one object.

    ``xyz`` and ``normals (M, 3) float32``, ``rgb (M, 3) uint8`` or None, ``edge (M,) uint16`` flags, the ``area`` of
    surface that they measure in m², and ``bounds``, the box x0, y0, x1, y1 around them.
    """

    xyz: Array
    normals: Array
    rgb: Array | None
    edge: Array
    area: float
    bounds: Box

    def __len__(self) -> int:
        return len(self.xyz)


def extract(image: DepthImage, box: Box, surface: Surface, chosen: Array, jump: tuple[float, float]) -> Pixels:
    """The pixels of ``box`` whose surface is a ``chosen (h, w) bool`` cell of ``surface``."""
    x0, y0, x1, y1 = box
    camera = image.intrinsics
    mask = np.zeros((y1 - y0 + 2, x1 - x0 + 2), np.uint8)  # with a rim, so that every pixel has eight neighbours
    kept = np.zeros((y1 - y0, x1 - x0), np.bool_)
    a, b = np.float32(jump[0]), np.float32(jump[1])
    h, w = surface.depth.shape
    rows = np.minimum((np.arange(y0, y1) - surface.top) // surface.step, h - 1)
    cols = np.minimum((np.arange(x0, x1) - surface.left) // surface.step, w - 1)
    depth = image.depth[y0:y1, x0:x1]
    count = _mark(depth, surface.depth, rows, cols, chosen, a, b, mask)
    xyz, normals = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    edge, bounds = np.empty(count, np.uint16), np.empty(4, np.int64)
    x, y = _slopes(x0, x1, camera.cx, camera.fx), _slopes(y0, y1, camera.cy, camera.fy)
    edges = _jumps(image.depth, x0, y0, a, b, kept)
    n, area = _gather(depth, mask, kept, edges, surface.normals, rows, cols, x, y, xyz, normals, edge, bounds)
    rgb = None if image.rgb is None else _colours(image.rgb, x0, y0, kept, n)
    area /= camera.fx * camera.fy
    around = (x0 + int(bounds[0]), y0 + int(bounds[1]), x0 + int(bounds[2]), y0 + int(bounds[3]))
    return Pixels(xyz[:n], normals[:n], rgb, edge[:n], area, around)


def _slopes(first: int, last: int, centre: float, focal: float) -> Array:
    return ((np.arange(first, last) - centre) / focal).astype(np.float32)


def _colours(rgb: Array, x0: int, y0: int, mask: Array, count: int) -> Array:
    out = np.empty((count, 3), np.uint8)
    _pick(rgb, x0, y0, mask, out)
    return out


@numba.njit(cache=True)
def _pick(rgb, x0, y0, mask, out):  # type: ignore[no-untyped-def]
    n = 0
    for v in range(mask.shape[0]):
        for u in range(mask.shape[1]):
            if mask[v, u]:
                for k in range(3):
                    out[n, k] = rgb[v + y0, u + x0, k]
                n += 1


@numba.njit(cache=True, fastmath=EXACT)
def _mark(depth, cells, rows, cols, chosen, a, b, mask):  # type: ignore[no-untyped-def]
    """Mark the pixels that belong to chosen cells: by their own cell, or by the nearest in depth around it."""
    count = 0
    for v in range(depth.shape[0]):
        i = rows[v]
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not (z > 0):
                continue
            j = cols[u]
            jump = a + b * z * z
            if cells[i, j] > 0 and abs(cells[i, j] - z) < jump:
                belongs = chosen[i, j]
            else:
                belongs = _nearest(cells, chosen, i, j, z, jump)
            mask[v + 1, u + 1] = belongs
            count += belongs
    return count


@numba.njit(cache=True, fastmath=EXACT)
def _nearest(cells, chosen, i, j, z, limit):  # type: ignore[no-untyped-def]
    """Whether the cell nearest in depth to z around (i, j) is chosen; False for none within ``limit``."""
    found = False
    for p in range(max(0, i - 1), min(cells.shape[0], i + 2)):
        for q in range(max(0, j - 1), min(cells.shape[1], j + 2)):
            off = abs(cells[p, q] - z)
            if cells[p, q] > 0 and off < limit:
                limit = off
                found = chosen[p, q]
    return found


@numba.njit(cache=True, fastmath=EXACT)
def _gather(depth, mask, kept, edges, cell_normals, rows, cols, x, y, xyz, normals, edge, bounds):  # type: ignore[no-untyped-def]
    """Fill the outputs from the marked pixels but for outliers, and ``kept``; their number and area times fx fy."""
    h, w = kept.shape
    area, n = 0.0, 0
    bounds[0], bounds[1], bounds[2], bounds[3] = w, h, 0, 0
    for v in range(h):
        i = rows[v]
        for u in range(w):
            if mask[v + 1, u + 1] == 0 or _neighbours(mask, v, u) < MIN_NEIGHBOURS:
                continue
            kept[v, u] = True
            z = depth[v, u]
            j = cols[u]
            n_x, n_y, n_z = cell_normals[0, i, j], cell_normals[1, i, j], cell_normals[2, i, j]
            xyz[n, 0], xyz[n, 1], xyz[n, 2] = x[u] * z, y[v] * z, z
            normals[n, 0], normals[n, 1], normals[n, 2] = n_x, n_y, n_z
            edge[n] = EDGE if edges[v, u] else 0
            cosine = abs(x[u] * n_x + y[v] * n_y + n_z)
            area += z * z / (max(cosine, MIN_COSINE) if cosine > 0 else UNKNOWN_COSINE)
            bounds[0], bounds[1] = min(bounds[0], u), min(bounds[1], v)
            bounds[2], bounds[3] = max(bounds[2], u + 1), v + 1
            n += 1
    return n, area


@numba.njit(cache=True, inline="always")
def _neighbours(mask, v, u):  # type: ignore[no-untyped-def]
    """How many of the eight neighbours of pixel (v, u) are marked; ``mask`` has a rim of one."""
    above, here, below = mask[v], mask[v + 1], mask[v + 2]
    beside = here[u] + here[u + 2]
    return above[u] + above[u + 1] + above[u + 2] + beside + below[u] + below[u + 1] + below[u + 2]


@numba.njit(cache=True, fastmath=EXACT)
def _jumps(depth, x0, y0, a, b, mask):  # type: ignore[no-untyped-def]
    """(h, w) bool like ``mask``: whether two rows or columns away there is no depth, or it lies across a depth jump."""
    edges = np.zeros(mask.shape, np.bool_)
    h, w = depth.shape
    for v in range(mask.shape[0]):
        up, down = depth[max(v + y0 - 2, 0)], depth[min(v + y0 + 2, h - 1)]
        row = depth[v + y0]
        for u in range(mask.shape[1]):
            k = u + x0
            z = row[k]
            across = max(abs(row[max(k - 2, 0)] - z), abs(row[min(k + 2, w - 1)] - z))
            edges[v, u] = not max(across, max(abs(up[k] - z), abs(down[k] - z))) < 2 * (a + b * z * z)
    return edges


def cell_points(surface: Surface, cells: Array, rgb: Array | None) -> tuple[Array, Array, Array | None]:
    """Points and normals (N, 3) float32 and colours (N, 3) uint8 or None of ``cells (h, w) bool`` of a whole frame."""
    n = int(np.count_nonzero(cells))
    xyz, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    _gather_cells(surface.depth, surface.normals, surface.x, surface.y, cells, xyz, normals)
    if rgb is None:
        return xyz, normals, None
    colours = np.empty((n, 3), np.uint8)
    _pick(rgb[:: surface.step, :: surface.step], 0, 0, cells, colours)
    return xyz, normals, colours


@numba.njit(cache=True)
def _gather_cells(depth, cell_normals, x, y, cells, xyz, normals):  # type: ignore[no-untyped-def]
    n = 0
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            if cells[i, j]:
                z = depth[i, j]
                xyz[n, 0], xyz[n, 1], xyz[n, 2] = x[j] * z, y[i] * z, z
                for k in range(3):
                    normals[n, k] = cell_normals[k, i, j]
                n += 1
