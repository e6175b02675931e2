# SPDX-License-Identifier: Apache-2.0
"""Connected parts of a surface: cells that touch without a depth jump between them.

Union-find over the cells (Rosenfeld and Pfaltz, "Sequential operations in digital picture processing", 1966), with
links that reach over small holes in the depth.
"""

from __future__ import annotations

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("components")


def connect(depth: Array, keep: Array, jump: tuple[float, float]) -> tuple[Array, int]:
    """The parts of the cells ``keep (h, w) bool``: labels (h, w) int32, 0 where not kept, else 1 … count; and count.

    Neighbours are linked where their ``depth (h, w)`` differs by less than a + b z² of ``jump`` = (a, b); so are cells
    with one cell without depth between them.
    """
    labels, count = _KERNELS.connect(depth, keep, *jump)
    return labels, count


def split(
    depth: Array, level: Array, seams: Array, jump: tuple[float, float], least: int, rounds: int
) -> tuple[Array, int]:
    """The parts of the cells with depth that are not ``level (h, w) bool``, parted at ``seams (h, w) bool``.

    Parts of fewer than ``least`` cells are dissolved; the others grow over those cells and over seams, one ring of
    cells in each of ``rounds``.
    Labels (h, w) int32, 0 for none, and their number.
    """
    labels, count = _KERNELS.split(depth, level, seams, *jump, least, rounds)
    return labels, count
