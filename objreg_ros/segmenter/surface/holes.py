# SPDX-License-Identifier: Apache-2.0
"""Holes in an object: what lies within it without a depth jump is of it, such as the flat bottom of a bowl."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.components import connect

_KERNELS = kernels("holes")


def fill_holes(chosen: Array, depth: Array, jump: tuple[float, float]) -> None:
    """Add to ``chosen (h, w) bool``, in place, the surfaces it surrounds that mostly go on without a depth jump.

    A surface is surrounded when it ends, at a depth jump or at a chosen cell, before it leaves the box around them.
    """
    left, top, right, bottom = _KERNELS.bounds(chosen)
    if right - left < 3 or bottom - top < 3:
        return
    within = np.ascontiguousarray(depth[top:bottom, left:right])
    labels, count = connect(within, ~chosen[top:bottom, left:right], jump)
    if count > 0:
        _KERNELS.fill(chosen, left, top, within, labels, count, *jump)
