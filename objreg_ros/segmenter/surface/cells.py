# SPDX-License-Identifier: Apache-2.0
"""The depth image at reduced size, as a surface: points with normals on a grid of cells.

Blocks of ``step`` × ``step`` pixels become one cell: the mean of the block's front surface, so that no cell lies
between two surfaces. Normals come from the gradient of inverse depth, which is linear in the pixel on a plane:
with n·p = d and p = z (x, y, 1), 1/z = (n_x x + n_y y + n_z) / d. The kernels have no branches, for the CPU's vectors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.native import kernels

Window = tuple[int, int, int, int]  # left, top, right, bottom in cells, half open

_KERNELS = kernels("cells")
CELL_ROWS = 240  # about as many rows of cells has a whole image
MIN_COSINE = np.float32(0.1)  # a surface seen flatter than this is not trusted with a larger area


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
    z_min, z_max, y_max = limits
    far = np.minimum(z_max, y_max / np.maximum(np.abs(y), 1e-6)).astype(np.float32)
    small, normals = np.empty((h, w), np.float32), np.zeros((3, h, w), np.float32)
    _KERNELS.shrink(depth, step, z_min, far, *jump, small)
    _KERNELS.normals(small, x, y, camera.fx / step, camera.fy / step, *jump, normals)
    return Surface(depth=small, normals=normals, x=x, y=y, top=0, left=0, step=step)
