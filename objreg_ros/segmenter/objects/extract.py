# SPDX-License-Identifier: Apache-2.0
"""From chosen cells back to full resolution: the pixels of an object with points, normals and edge flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.native import kernels
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.surface.cells import MIN_COSINE, Surface

_KERNELS = kernels("extract")
EDGE = int(PointFlag.EDGE)
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
    pinhole = (camera.fx, camera.fy, camera.cx, camera.cy)
    xyz, normals, rgb, edge, area, around = _KERNELS.extract(
        image.depth, colours(image), box, grid, pinhole, jump, EDGE, MIN_COSINE
    )
    return Pixels(xyz, normals, rgb if image.rgb is not None else None, edge, area / (camera.fx * camera.fy), around)


def cell_points(surface: Surface, cells: Array, rgb: Array) -> tuple[Array, Array, Array]:
    """Points and normals (N, 3) float32 and colours (N, 3) uint8 of ``cells (h, w) bool`` of a whole frame.

    ``rgb (H, W, 3) uint8`` is the whole picture; without colour its height is 0 and so is N of the colours.
    """
    depth, step = surface.depth, surface.step
    return tuple(_KERNELS.gather_cells(depth, surface.normals, surface.x, surface.y, step, rgb, cells))
