# SPDX-License-Identifier: Apache-2.0
"""An upright motion is moved out of seen free space, until each shape lies within the visual hull of the other.

Two sides of an object that share no surface still locate it: what the one camera saw must fall inside the
outline that the other saw, or behind it. From a start that is decimetres off, where no point has a partner, each point
that floats beside an outline is drawn to its rim, each that floats before the surface, behind it. (Laurentini, "The
visual hull concept for silhouette-based image understanding", 1994.)
"""

from __future__ import annotations

from typing import Any

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("visual_hull")


def clear(source: tuple[Any, ...], target: tuple[Any, ...], motion: Array, most: int, rounds: int) -> float:
    """Move ``motion (yaw, x, y, rise)`` in place, but for its rise, to where the first ``most`` points float least.

    ``source`` and ``target`` are `Shape.kernel_arrays`. Returns by how many metres, all together, they float there.
    """
    return float(_KERNELS.clear(source, target, motion, most, rounds))
