# SPDX-License-Identifier: Apache-2.0
"""What one view says of the points of another: which agree, which float in seen free space, which are hidden."""

from __future__ import annotations

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("free_space")
# What `count` counts, in the order of its result.
SEEN, INLIERS, VIOLATIONS, OCCLUDED, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB = range(10)

Camera = tuple[float, float, float, float]


def count(
    points: Array,
    shades: Array,
    T: Array,
    near: Array,
    far: Array,
    detail: Array,
    camera: Camera,
    tolerance: float,
    growth: float,
) -> Array:
    """Count what the view (near, far, detail, camera) says of ``points`` moved by ``T (4, 4)``.

    A depth agrees within ``tolerance + growth z^2``. Returns (10,) float64 in the order SEEN ... SUM_AB; the sums are
    of the shades of the inliers (A) and of the detail where they land (B).
    """
    counts: Array = _KERNELS.count(points, shades, T, near, far, detail, camera, tolerance, growth)
    return counts


def count_many(
    points: Array,
    shades: Array,
    T: Array,
    near: Array,
    far: Array,
    detail: Array,
    camera: Camera,
    tolerance: float,
    growth: float,
) -> Array:
    """`count` for many poses (K, 4, 4): (K, 10)."""
    counts: Array = _KERNELS.count_many(points, shades, T, near, far, detail, camera, tolerance, growth)
    return counts


def correlation(counts: Array) -> float:
    """The normalised correlation -1..1 of the shades in ``counts (10,)``.

    0 with fewer than 30 of them or none that vary.
    """
    return float(_KERNELS.correlation(counts))
