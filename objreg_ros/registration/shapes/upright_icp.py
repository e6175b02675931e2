# SPDX-License-Identifier: Apache-2.0
"""A robust point-to-plane ICP of an upright motion: yaw and two level shifts, on a closest-point grid."""

from __future__ import annotations

from typing import Any

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("upright_icp")


def settle(
    xyz: Array,
    normals: Array,
    most: int,
    surface: tuple[Any, ...],
    motion: Array,
    reach: float,
    last_reach: float,
    iterations: int,
) -> int:
    """Move ``motion (yaw, x, y, rise)`` in place, but for its rise, to the surface; returns how many pairs it found.

    ``surface`` is `IndexedSurface.grid`; pairs lie within ``reach`` m at first and ``last_reach`` at last.
    """
    return int(_KERNELS.settle(xyz, normals, most, surface, motion, reach, last_reach, iterations))
