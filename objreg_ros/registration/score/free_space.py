# SPDX-License-Identifier: Apache-2.0
"""What one view says of the points of another: which agree, which float in seen free space, which are hidden."""

from __future__ import annotations

from collections.abc import Callable

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("free_space")
# What `count` counts, in the order of its result.
SEEN, INLIERS, VIOLATIONS, OCCLUDED, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB = range(10)


# What a view (near, far, detail, camera) says of ``points (N, 3)`` with ``shades (N,)`` moved by ``T``. A depth agrees
# within ``tolerance + growth z^2``; sums are of the shades of the inliers (A) and of the detail where they land (B).
# (points, shades, T, near, far, detail, camera, tolerance, growth), camera being (fx, fy, cx, cy):
count: Callable[..., Array] = _KERNELS.count  # T (4, 4): (10,) float64 in the order SEEN ... SUM_AB
count_many: Callable[..., Array] = _KERNELS.count_many  # T (K, 4, 4): (K, 10)


def correlation(counts: Array) -> float:
    """The normalised correlation -1..1 of the shades in ``counts (10,)``.

    0 with fewer than 30 of them or none that vary.
    """
    return float(_KERNELS.correlation(counts))
