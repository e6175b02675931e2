# SPDX-License-Identifier: Apache-2.0
"""The depth image at reduced size, as a surface: points with normals on a grid of cells.

Blocks of ``step`` × ``step`` pixels become one cell: the mean of the block's front surface, so that no cell lies
between two surfaces. Normals come from the gradient of inverse depth, which is linear in the pixel on a plane:
with n·p = d and p = z (x, y, 1), 1/z = (n_x x + n_y y + n_z) / d. The kernels have no branches, for the CPU's vectors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics

Window = tuple[int, int, int, int]  # left, top, right, bottom in cells, half open

CELL_ROWS = 240  # about as many rows of cells has a whole image
REACH = 3  # cells from the middle of a gradient to its ends
MIN_COSINE = np.float32(0.1)  # a surface seen flatter than this is not trusted with a larger area
EXACT = {"reassoc", "contract", "arcp", "nsz"}  # fast arithmetic that still knows NaN


@dataclass(frozen=True, slots=True)
class Surface:
    """``depth (h, w)`` m, 0 where there is none; ``normals (3, h, w)`` towards the camera, 0 0 0 where unknown.

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

    def crop(self, window: Window) -> Surface:
        """A copy of the cells of ``window``, which must lie inside."""
        left, top, right, bottom = window
        return Surface(
            depth=np.ascontiguousarray(self.depth[top:bottom, left:right]),
            normals=np.ascontiguousarray(self.normals[:, top:bottom, left:right]),
            x=self.x[left:right],
            y=self.y[top:bottom],
            top=self.top + top * self.step,
            left=self.left + left * self.step,
            step=self.step,
        )

    def every(self, stride: int) -> Surface:
        """A copy of every ``stride``-th cell of each row and column."""
        return Surface(
            depth=np.ascontiguousarray(self.depth[::stride, ::stride]),
            normals=np.ascontiguousarray(self.normals[:, ::stride, ::stride]),
            x=np.ascontiguousarray(self.x[::stride]),
            y=np.ascontiguousarray(self.y[::stride]),
            top=self.top,
            left=self.left,
            step=self.step * stride,
        )


def cell_size(height: int, width: int) -> int:
    """Pixels per cell for an image of this size: 2 at 640 × 480."""
    return max(1, round(min(height, width * 3 / 4) / CELL_ROWS))


def reduce(
    depth: Array, camera: Intrinsics, step: int, limits: tuple[float, float, float], jump: tuple[float, float]
) -> Surface:
    """The surface of a whole depth image (H, W) float32 in cells of ``step`` pixels; what is left over is not covered.

    ``limits`` are z_min, z_max and y_max in metres; ``jump`` (a, b) is the depth step a + b z² between two surfaces.
    """
    h, w = depth.shape[0] // step, depth.shape[1] // step
    x = ((np.arange(w) * step + (step - 1) / 2 - camera.cx) / camera.fx).astype(np.float32)
    y = ((np.arange(h) * step + (step - 1) / 2 - camera.cy) / camera.fy).astype(np.float32)
    small = np.empty((h, w), np.float32)
    a, b = np.float32(jump[0]), np.float32(jump[1])
    z_min, z_max, y_max = limits
    far = np.minimum(z_max, y_max / np.maximum(np.abs(y), 1e-6)).astype(np.float32)
    if step == 2:
        _halve(depth, np.float32(z_min), far, a, b, small)
    else:
        _shrink(depth, step, np.float32(z_min), far, a, b, small)
    normals = np.zeros((3, h, w), np.float32)
    if min(h, w) > 2 * REACH:
        scales = np.float32(camera.fx / step / REACH), np.float32(camera.fy / step / REACH)
        _normals(small, x, y, *scales, a, b, normals)
    return Surface(depth=small, normals=normals, x=x, y=y, top=0, left=0, step=step)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _halve(depth, z_min, far, a, b, out):  # type: ignore[no-untyped-def]
    """`_shrink` for cells of 2 × 2 pixels, as they are at 640 × 480, in one pass."""
    zero, one, beyond = np.float32(0), np.float32(1), np.float32(np.inf)
    for i in range(out.shape[0]):
        upper, lower, cells = depth[2 * i], depth[2 * i + 1], out[i]
        for j in range(len(cells)):
            p, q, r, s = upper[2 * j], upper[2 * j + 1], lower[2 * j], lower[2 * j + 1]
            p, q = p if p > z_min else beyond, q if q > z_min else beyond
            r, s = r if r > z_min else beyond, s if s > z_min else beyond
            near = min(min(p, q), min(r, s))
            limit = min(near + a + b * near * near, far[i])
            total = ((p if p < limit else zero) + (q if q < limit else zero)) + (
                (r if r < limit else zero) + (s if s < limit else zero)
            )
            count = ((one if p < limit else zero) + (one if q < limit else zero)) + (
                (one if r < limit else zero) + (one if s < limit else zero)
            )
            cells[j] = total / max(count, one)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _shrink(depth, step, z_min, far, a, b, out):  # type: ignore[no-untyped-def]
    """Each cell: the mean of the pixels within a depth step of its block's nearest one, nearer than ``far (h,)``."""
    h, w = out.shape
    zero, one = np.float32(0), np.float32(1)
    near, total, count = np.empty(w, np.float32), np.empty(w, np.float32), np.empty(w, np.float32)
    for i in range(h):
        near[:], total[:], count[:] = far[i], zero, zero
        for v in range(i * step, i * step + step):
            for du in range(step):
                row = depth[v, du:]
                for j in range(w):
                    z = row[j * step]
                    near[j] = z if (z > z_min) & (z < near[j]) else near[j]
        for j in range(w):
            near[j] = min(near[j] + a + b * near[j] * near[j], far[i])
        for v in range(i * step, i * step + step):
            for du in range(step):
                row = depth[v, du:]
                for j in range(w):
                    z = row[j * step]
                    good = (z > z_min) & (z < near[j])
                    total[j] += z if good else zero
                    count[j] += one if good else zero
        for j in range(w):
            out[i, j] = total[j] / max(count[j], one)


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
def _normals(depth, x, y, fx, fy, a, b, normals):  # type: ignore[no-untyped-def]
    """Fill ``normals``: gradients over REACH cells to both sides, of lines that are the mean of three.

    Where a line bends or breaks in its middle only its flatter half counts, so that edges stay sharp. A depth step of
    a + b z² is one of a / z² + b in inverse depth.
    """
    h, w = depth.shape
    zero, one, third = np.float32(0), np.float32(1), np.float32(3)
    near = np.empty((h, w), np.float32)
    upright, flat = np.zeros((h, w), np.float32), np.zeros((h, w), np.float32)
    for i in range(h):
        for j in range(w):
            z = depth[i, j]
            near[i, j] = one / z if z > zero else zero
    for i in range(1, h - 1):
        for j in range(1, w - 1):
            c = near[i, j]
            limit = a * c * c + b
            p, q = near[i - 1, j], near[i + 1, j]
            g, k = abs(p - c) < limit, abs(q - c) < limit
            upright[i, j] = (c + (p if g else zero) + (q if k else zero)) / (
                one + (one if g else zero) + (one if k else zero)
            )
            p, q = near[i, j - 1], near[i, j + 1]
            g, k = abs(p - c) < limit, abs(q - c) < limit
            flat[i, j] = (c + (p if g else zero) + (q if k else zero)) / (
                one + (one if g else zero) + (one if k else zero)
            )
    for i in range(REACH, h - REACH):
        for j in range(REACH, w - REACH):
            c = near[i, j]
            limit = a * c * c + b
            steep = third * limit
            m = upright[i, j]
            f, g = upright[i, j + REACH] - m, m - upright[i, j - REACH]
            flatter = f if abs(f) < abs(g) else g
            across = np.float32(0.5) * (f + g) if abs(f - g) < limit else flatter
            m = flat[i, j]
            f, g = flat[i + REACH, j] - m, m - flat[i - REACH, j]
            flatter = f if abs(f) < abs(g) else g
            down = np.float32(0.5) * (f + g) if abs(f - g) < limit else flatter
            known = c > zero and abs(across) < steep and abs(down) < steep
            n_x, n_y = across * fx, down * fy
            n_z = c - x[j] * n_x - y[i] * n_y
            length = -one / np.sqrt(max(n_x * n_x + n_y * n_y + n_z * n_z, np.float32(1e-12)))
            normals[0, i, j] = n_x * length if known else zero
            normals[1, i, j] = n_y * length if known else zero
            normals[2, i, j] = n_z * length if known else zero
