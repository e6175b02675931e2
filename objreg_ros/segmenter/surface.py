# SPDX-License-Identifier: Apache-2.0
"""A patch of the depth image at reduced size: points with normals, on a grid.

Blocks of ``step`` × ``step`` pixels become one cell: the mean of the block's front surface, so that no cell lies
between two surfaces. Normals come from the gradient of inverse depth, which is linear in the pixel on a plane:
with n·p = d and p = z (x, y, 1), 1/z = (n_x x + n_y y + n_z) / d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array, Intrinsics

MIN_COSINE = np.float32(0.1)  # a surface seen flatter than this is not trusted with a larger area
EXACT = {"reassoc", "contract", "arcp", "nsz"}  # fast arithmetic that still knows NaN


@dataclass(frozen=True, slots=True)
class Surface:
    """``depth (h, w)`` m, 0 where there is none; ``normals (h, w, 3)`` towards the camera, 0 0 0 where unknown.

    Cell (i, j) covers pixels ``top + i·step … + step`` and ``left + j·step … + step``; ``x (w,)`` and ``y (h,)`` are
    the slopes of its ray. All float32.
    """

    depth: Array
    normals: Array
    x: Array
    y: Array
    top: int
    left: int
    step: int

    @property
    def points(self) -> Array:
        """(h, w, 3) points, 0 0 0 where there is none."""
        return np.stack([self.x[None, :] * self.depth, self.y[:, None] * self.depth, self.depth], axis=-1)

    def areas(self, camera: Intrinsics) -> Array:
        """(h, w) m² of surface in each cell, z² / (fx fy |n·ray|); 0 where the normal is unknown."""
        n_x, n_y, n_z = np.moveaxis(self.normals, -1, 0)
        cosine = np.abs(n_x * self.x[None, :] + n_y * self.y[:, None] + n_z)
        square = self.depth**2 * np.float32(self.step**2 / (camera.fx * camera.fy))
        return np.where(cosine > 0, square / np.maximum(cosine, MIN_COSINE), np.float32(0))


def reduce(
    depth: Array,
    camera: Intrinsics,
    box: tuple[int, int, int, int],
    step: int,
    limits: tuple[float, float, float],
    jump: tuple[float, float],
) -> Surface:
    """The surface of ``box`` (x0, y0, x1, y1 pixels inside ``depth (H, W)``) in cells of ``step`` pixels.

    ``limits`` are z_min, z_max and y_max in metres; ``jump`` (a, b) is the depth step a + b z² between two surfaces.
    """
    x0, y0, x1, y1 = box
    x = ((x0 + np.arange((x1 - x0) // step) * step + (step - 1) / 2 - camera.cx) / camera.fx).astype(np.float32)
    y = ((y0 + np.arange((y1 - y0) // step) * step + (step - 1) / 2 - camera.cy) / camera.fy).astype(np.float32)
    bounds = np.array([*limits, *jump], np.float32)
    small = np.empty((len(y), len(x)), np.float32)
    _shrink(depth, y0, x0, step, y, bounds, small)
    normals = np.zeros((*small.shape, 3), np.float32)
    _normals(small, x, y, np.float32(camera.fx / step), np.float32(camera.fy / step), bounds, normals)
    return Surface(depth=small, normals=normals, x=x, y=y, top=y0, left=x0, step=step)


@numba.njit(cache=True, fastmath=EXACT)
def _shrink(depth, top, left, step, y, bounds, out):  # type: ignore[no-untyped-def]
    """Each cell: the mean of the pixels within a depth step of the block's nearest one."""
    z_min, z_max, y_max, a, b = bounds
    for i in range(out.shape[0]):
        far = min(z_max, y_max / max(abs(y[i]), np.float32(1e-6)))
        for j in range(out.shape[1]):
            near = far
            for v in range(top + i * step, top + (i + 1) * step):
                for u in range(left + j * step, left + (j + 1) * step):
                    z = depth[v, u]
                    if z > z_min and z < near:
                        near = z
            total, count = np.float32(0), 0
            limit = min(far, near + a + b * near * near)
            if near < far:
                for v in range(top + i * step, top + (i + 1) * step):
                    for u in range(left + j * step, left + (j + 1) * step):
                        z = depth[v, u]
                        if z > z_min and z < limit:
                            total += z
                            count += 1
            out[i, j] = total / count if count > 0 else np.float32(0)


REACH = 3  # cells from the centre to the end of a gradient's arm


@numba.njit(cache=True, fastmath=EXACT)
def _normals(depth, x, y, fx, fy, bounds, normals):  # type: ignore[no-untyped-def]
    """Fill ``normals``: the inverse depth's gradient over arms of REACH cells, three rows (columns) wide."""
    h, w = depth.shape
    one = np.float32(1)
    for i in range(h):
        for j in range(w):
            z = depth[i, j]
            if z <= 0:
                continue
            jump = bounds[3] + bounds[4] * z * z
            across = _slope(depth, i, j, 0, 1, z, jump)
            down = _slope(depth, i, j, 1, 0, z, jump)
            if across != across or down != down:
                continue
            n_x = across * fx
            n_y = down * fy
            n_z = one / z - x[j] * n_x - y[i] * n_y
            length = -one / np.sqrt(n_x * n_x + n_y * n_y + n_z * n_z)
            normals[i, j, 0] = n_x * length
            normals[i, j, 1] = n_y * length
            normals[i, j, 2] = n_z * length


@numba.njit(cache=True, fastmath=EXACT, inline="always")
def _slope(depth, i, j, di, dj, z, jump):  # type: ignore[no-untyped-def]
    """Change of inverse depth per cell along (di, dj), the mean of three parallel lines; NaN where there is none.

    Where a line bends or breaks in its middle, only its flatter half counts, so that edges stay sharp.
    """
    h, w = depth.shape
    total, span = np.float32(0), 0
    for side in range(-1, 2):
        a, b = i + side * dj, j + side * di
        if a < 0 or b < 0 or a >= h or b >= w:
            continue
        middle = depth[a, b]
        if not (abs(middle - z) < jump):
            continue
        p, q = a + REACH * di, b + REACH * dj
        r, s = a - REACH * di, b - REACH * dj
        after = depth[p, q] if p < h and q < w else np.float32(0)
        before = depth[r, s] if r >= 0 and s >= 0 else np.float32(0)
        ahead, behind = abs(after - middle), abs(middle - before)
        if after > 0 and before > 0 and abs(after + before - 2 * middle) < jump:
            total += np.float32(1) / after - np.float32(1) / before
            span += 2 * REACH
        elif after > 0 and ahead < 3 * jump and (ahead < behind or before <= 0):
            total += np.float32(1) / after - np.float32(1) / middle
            span += REACH
        elif before > 0 and behind < 3 * jump:
            total += np.float32(1) / middle - np.float32(1) / before
            span += REACH
    return total / span if span > 0 else np.float32(np.nan)
