# SPDX-License-Identifier: Apache-2.0
"""What around a box is support surface: the cells within the noise of a level plane, fitted anew where the box is.

A depth camera bends planes by some millimetres over the frame, so only a local fit parts a thin book from its table.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.cells import Surface, Window
from objreg_ros.segmenter.surface.support import TOLERANCE, Ground, Plane, fit_level

_KERNELS = kernels("level")
MANY = 9000  # cells of which every third in each row and column is enough for a plane
REACH = 3  # coarse cells that a support surface is thought to go on
SPREADS = 2.0  # standard deviations of the surface's noise
MAX_SPREAD = 0.5  # tolerances; what is rougher is no plane


def support_cells(around: Surface, window: Window, ground: Ground, base: float) -> tuple[Array, bool]:
    """(h, w) bool: the cells of ``around`` that are support surfaces, and whether there is one.

    ``window`` is the box in cells of the whole frame, ``around`` a crop of it; ``base`` metres are added to the noise.
    """
    level = np.zeros(around.depth.shape, np.bool_)
    here = np.empty(around.depth.shape, np.bool_)
    found = False
    if ground.up is None:
        return level, found
    grid = (around.depth, around.x, around.y, (around.left, around.top, around.step))
    for support in ground.supports:
        sought = (support.parts, support.total, *_equation(support.plane), TOLERANCE, window)
        if not _KERNELS.find_beneath(*sought, grid, ground.coarse.step, REACH, here):
            continue
        stride = 2 if here.size <= MANY else 3
        plane = fit_level(around, here, ground.up, support.plane, stride, lowest=True)
        if plane is None or plane.spread > MAX_SPREAD:
            plane = support.plane
        limit = SPREADS * min(plane.spread, MAX_SPREAD)
        _KERNELS.mark(around.depth, around.x, around.y, here, *_equation(plane), base, limit, TOLERANCE, level)
        found = True
    return level, found


def _equation(plane: Plane) -> tuple[Array, np.float32]:
    return plane.normal.astype(np.float32), np.float32(plane.offset)
