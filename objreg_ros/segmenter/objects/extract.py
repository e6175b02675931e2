# SPDX-License-Identifier: Apache-2.0
"""From chosen cells back to full resolution: the pixels of an object with points, normals and edge flags."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.surface.cells import EXACT, MIN_COSINE, Surface

FAR = np.float32(65.0)  # m: the step of depth that is no edge grows beyond all there
EDGE = int(PointFlag.EDGE)
UNKNOWN_COSINE = np.float32(0.7)  # of a surface whose normal is not known
MIN_NEIGHBOURS = 2  # of 8; a pixel with fewer in its object is an outlier
NO_COLOUR = np.zeros((0, 0, 3), np.uint8)
NO_COLOUR.flags.writeable = False  # as the arrays of a DepthImage, so that one kernel serves both


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


def colours(image: DepthImage) -> Array:
    """The colours (H, W, 3) uint8 of an image; of height 0 where it has none."""
    return NO_COLOUR if image.rgb is None else image.rgb


def extract(image: DepthImage, box: Box, surface: Surface, chosen: Array, jump: tuple[float, float]) -> Pixels:
    """The pixels of ``box`` whose surface is a ``chosen (h, w) bool`` cell of ``surface``."""
    camera = image.intrinsics
    grid = (surface.depth, surface.normals, chosen, (surface.left, surface.top, surface.step))
    pinhole = (float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy))
    bounds = np.float32(jump[0]), np.float32(jump[1])
    xyz, normals, rgb, edge, area, around = _extract(image.depth, colours(image), box, grid, pinhole, bounds)
    return Pixels(xyz, normals, rgb if image.rgb is not None else None, edge, area / (camera.fx * camera.fy), around)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _extract(depth, rgb, box, grid, pinhole, jump):  # type: ignore[no-untyped-def]
    """The fields of `Pixels`, the area times fx fy; row by row, and in each row run by run of pixels that are kept."""
    x0, y0, x1, y1 = box
    fx, fy, cx, cy = pinhole
    cols, x = _columns(x0, x1, grid, fx, cx)
    mask = np.zeros((y1 - y0 + 2, x1 - x0 + 2), np.uint8)  # with a rim, so that every pixel has eight neighbours
    count = _mark(depth, box, grid, cols, jump, mask)
    xyz, normals = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    colour, edge = np.empty((count if len(rgb) > 0 else 0, 3), np.uint8), np.empty(count, np.uint16)
    kept, flags = np.empty(x1 - x0, np.uint8), np.empty(x1 - x0, np.uint16)
    n, area, around = 0, 0.0, (x1, y1, x0, y0)
    for v in range(y0, y1):
        left, right = _keep(mask[v - y0], mask[v - y0 + 1], mask[v - y0 + 2], kept)
        if left == right:
            continue
        around = (min(around[0], x0 + left), min(around[1], v), max(around[2], x0 + right), v + 1)
        _flag_jumps(depth, v, x0 + left, x0 + right, jump, flags[left:])
        y = np.float32((v - cy) / fy)
        cell_normals = grid[1][:, _row(v, grid)]
        while left < right:
            last = left
            while last < right and kept[last]:
                last += 1
            z = depth[v, x0 + left : x0 + last]
            area += _fill(x[left:], y, z, cell_normals, cols[left:], xyz[n:], normals[n:])
            for k in range(last - left):
                edge[n + k] = flags[left + k]
            if len(rgb) > 0:
                _copy(rgb[v, x0 + left : x0 + last], colour[n:])
            n, left = n + last - left, last
            while left < right and not kept[left]:
                left += 1
    return xyz[:n], normals[:n], colour[:n], edge[:n], area, around


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _columns(x0, x1, grid, fx, cx):  # type: ignore[no-untyped-def]
    """Of each column of pixels the column of its cells, and the slope of its ray."""
    left, _, step = grid[3]
    cols, x = np.empty(x1 - x0, np.int32), np.empty(x1 - x0, np.float32)
    for u in range(x0, x1):
        cols[u - x0] = min((u - left) // step, grid[0].shape[1] - 1)
        x[u - x0] = (u - cx) / fx
    return cols, x


@numba.njit(cache=True, nogil=True)
def _row(v, grid):  # type: ignore[no-untyped-def]
    """The row of the cells of a row of pixels."""
    _, top, step = grid[3]
    return min((v - top) // step, grid[0].shape[0] - 1)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _mark(depth, box, grid, cols, jump, mask):  # type: ignore[no-untyped-def]
    """Mark the pixels that belong to chosen cells, by their own cell or by the nearest in depth around it; count them.

    A row's cells are spread over its pixels first, so that the CPU's vectors decide about all but a few."""
    cells, _, chosen, _ = grid
    x0, y0, x1, y1 = box
    n, now = x1 - x0, -1
    near = _spread(chosen)
    cell, own, possible = np.empty(n, np.float32), np.empty(n, np.uint8), np.empty(n, np.uint8)
    open_ends = np.empty(n, np.uint8)
    count, some = 0, False
    for v in range(y0, y1):
        i = _row(v, grid)
        if i != now:
            some, now = _unfold(cells[i], chosen[i], near[i], cols, cell, own, possible), i
        if not some:
            continue
        row, marks = depth[v, x0:x1], mask[v - y0 + 1, 1:]
        found, doubtful = 0, 0
        for u in range(n):
            z = row[u]
            known = (z > 0) & (z < FAR)
            agrees = (abs(cell[u] - z) < jump[0] + jump[1] * z * z) & (cell[u] > 0) & known
            marks[u] = own[u] if agrees else 0
            found += own[u] if agrees else 0
            open_ends[u] = 0 if agrees else (possible[u] if known else 0)
            doubtful += open_ends[u]
        if doubtful > 0:
            for u in range(n):
                if open_ends[u]:
                    z = row[u]
                    marks[u] = _nearest(cells, chosen, i, cols[u], z, jump[0] + jump[1] * z * z)
                    found += marks[u]
        count += found
    return count


@numba.njit(cache=True, nogil=True)
def _unfold(cells, chosen, near, cols, cell, own, possible):  # type: ignore[no-untyped-def]
    """Fill what a row of pixels needs of its row of cells; whether any pixel can belong to a chosen one."""
    some = False
    for u in range(len(cols)):
        j = cols[u]
        cell[u], own[u], possible[u] = cells[j], chosen[j], near[j]
        some |= near[j]
    return some


@numba.njit(cache=True, nogil=True)
def _spread(chosen):  # type: ignore[no-untyped-def]
    """(h, w) bool: the cells that are chosen or have a chosen one beside them, across corners too."""
    h, w = chosen.shape
    spread = np.empty((h, w), np.bool_)
    column = np.zeros(w + 2, np.bool_)
    for i in range(h):
        above, here, below = chosen[max(i - 1, 0)], chosen[i], chosen[min(i + 1, h - 1)]
        middle, right, out = column[1:], column[2:], spread[i]
        for j in range(w):
            middle[j] = above[j] | here[j] | below[j]
        for j in range(w):
            out[j] = column[j] | middle[j] | right[j]
    return spread


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
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


@numba.njit(cache=True, nogil=True)
def _keep(above, here, below, kept):  # type: ignore[no-untyped-def]
    """Fill ``kept (w,)``: the marked pixels of a row but for outliers; the first of them and the one after the last.

    The rows of the mask have a rim of one."""
    above_right, here_right, below_right = above[2:], here[2:], below[2:]
    above_middle, middle, below_middle = above[1:], here[1:], below[1:]
    for u in range(len(kept)):
        beside = here[u] + here_right[u] + above_middle[u] + below_middle[u]
        across = above[u] + above_right[u] + below[u] + below_right[u]
        kept[u] = middle[u] if beside + across >= MIN_NEIGHBOURS else 0
    first, end = 0, len(kept)
    while first < end and not kept[first]:
        first += 1
    while end > first and not kept[end - 1]:
        end -= 1
    return first, end


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _flag_jumps(depth, v, x0, x1, jump, flags):  # type: ignore[no-untyped-def]
    """Fill ``flags (x1 - x0,)``: EDGE where two rows or columns away is no depth or a depth beyond a jump, else 0."""
    h, w = depth.shape
    n = x1 - x0
    up, here, down = depth[max(v - 2, 0)][x0:], depth[v][x0:], depth[min(v + 2, h - 1)][x0:]
    wide = np.empty(n + 4, np.float32)  # the row with two more pixels at each side, the image's last ones repeated
    for k in range(2):
        wide[k] = depth[v, max(x0 + k - 2, 0)]
        wide[n + 2 + k] = depth[v, min(x1 + k, w - 1)]
    for u in range(n):
        wide[u + 2] = here[u]
    right = wide[4:]
    for u in range(n):
        z = here[u]
        across = max(max(abs(wide[u] - z), abs(right[u] - z)), max(abs(up[u] - z), abs(down[u] - z)))
        flags[u] = EDGE if not across < np.float32(2) * (jump[0] + jump[1] * z * z) else 0


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _fill(x, y, z, cell_normals, cols, xyz, normals):  # type: ignore[no-untyped-def]
    """Fill the points and normals of pixels of a row that lie side by side; their area times fx fy."""
    n_x, n_y, n_z = cell_normals[0], cell_normals[1], cell_normals[2]
    area = np.float32(0)
    for k in range(len(z)):
        j = cols[k]
        a, b, c = n_x[j], n_y[j], n_z[j]
        xyz[k, 0], xyz[k, 1], xyz[k, 2] = x[k] * z[k], y * z[k], z[k]
        normals[k, 0], normals[k, 1], normals[k, 2] = a, b, c
        cosine = abs(x[k] * a + y * b + c)
        area += z[k] * z[k] / (max(cosine, MIN_COSINE) if cosine > 0 else UNKNOWN_COSINE)
    return area


@numba.njit(cache=True, nogil=True)
def _copy(pixels, out):  # type: ignore[no-untyped-def]
    for k in range(len(pixels)):
        out[k, 0], out[k, 1], out[k, 2] = pixels[k, 0], pixels[k, 1], pixels[k, 2]


def cell_points(surface: Surface, cells: Array, rgb: Array) -> tuple[Array, Array, Array]:
    """Points and normals (N, 3) float32 and colours (N, 3) uint8 of ``cells (h, w) bool`` of a whole frame.

    ``rgb (H, W, 3) uint8`` is the whole picture; without colour its height is 0 and so is N of the colours.
    """
    return tuple(_gather_cells(surface.depth, surface.normals, surface.x, surface.y, surface.step, rgb, cells))


@numba.njit(cache=True, nogil=True)
def _gather_cells(depth, cell_normals, x, y, step, rgb, cells):  # type: ignore[no-untyped-def]
    count = 0
    for i in range(depth.shape[0]):
        row = cells[i]
        for j in range(len(row)):
            count += row[j]
    xyz, normals = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    colour = np.empty((count if len(rgb) > 0 else 0, 3), np.uint8)
    n = 0
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            if not cells[i, j]:
                continue
            z = depth[i, j]
            xyz[n, 0], xyz[n, 1], xyz[n, 2] = x[j] * z, y[i] * z, z
            for k in range(3):
                normals[n, k] = cell_normals[k, i, j]
            if len(rgb) > 0:
                for k in range(3):
                    colour[n, k] = rgb[i * step, j * step, k]
            n += 1
    return xyz, normals, colour
