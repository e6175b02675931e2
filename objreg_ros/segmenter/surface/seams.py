# SPDX-License-Identifier: Apache-2.0
"""Seams between objects: valleys where they touch, and small steps where one covers the other.

Objects are mostly convex, so the seam between two of them is mostly concave (Stein, Schoeler, Papon and Wörgötter,
"Object partitioning using local convexity", CVPR 2014): with normals n and points p on both sides of a cell,
(n_b - n_a)·(p_b - p_a) < 0 is a valley.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.cells import Surface

_KERNELS = kernels("seams")


def find_seams(surface: Surface, angle_deg: float, jump: tuple[float, float]) -> Array:
    """(h, w) bool: the cells in a valley that bends by more than ``angle_deg``, or at a step.

    From 1 m on the angle grows with the distance, as both the noise of normals and the length that they span do.

    A step is a second difference of the depth of more than half the ``jump`` a + b z²: it vanishes on a plane however
    that slants, and sees a step that is spread over mixed pixels.
    """
    seams = np.zeros(surface.depth.shape, np.bool_)
    bend = (2 * np.sin(np.radians(angle_deg) / 2)) ** 2
    _KERNELS.find(surface.depth, surface.normals, surface.x, surface.y, bend, *jump, seams)
    return seams
