# SPDX-License-Identifier: Apache-2.0
"""What one view says of the points of another: which agree, which float in seen free space, which are hidden."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.registration.kernels.projection import FAST, between, lands, nearest, project
from objreg_ros.registration.prepare.views import SHADELESS

# What `count` counts, in the order of its result.
SEEN, INLIERS, VIOLATIONS, OCCLUDED, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB = range(10)


@numba.njit(cache=True, fastmath=FAST, nogil=True)
def count(points, shades, T, near, far, detail, camera, tolerance, growth):  # type: ignore[no-untyped-def]
    """Count what the view (near, far, detail, camera) says of ``points`` moved by ``T (4, 4)``.

    A depth agrees within ``tolerance + growth z^2``. Returns (10,) float64 in the order SEEN ... SUM_AB; the sums are
    of the shades of the inliers (A) and of the detail where they land (B).
    """
    inliers = violations = occluded = shaded = 0
    a = b = aa = bb = ab = 0.0
    us, vs, zs = project(points, T, camera)
    for i in range(len(points)):
        u, v, z = us[i], vs[i], zs[i]
        if not lands(u, v, z, near):
            continue
        row, column = nearest(u, v)
        low, high = near[row, column], far[row, column]
        slop = tolerance + growth * z * z
        measured = high > 0.0
        before, behind = measured & (z < low - slop), measured & (z > high + slop)
        between_sides = (z > low + slop) & (z < high - slop)  # of an edge: says nothing
        on = measured & ~(before | behind | between_sides)
        violations += before
        occluded += behind
        inliers += on
        own = shades[i]
        if not (on & (own < SHADELESS) & (high - low <= 2.0 * slop)):  # silhouettes look alike everywhere
            continue
        shade, _, _ = between(detail, u, v)
        shaded += 1
        a += own
        b += shade
        aa += own * own
        bb += shade * shade
        ab += own * shade
    out = np.empty(10)
    out[SEEN], out[INLIERS], out[VIOLATIONS] = inliers + violations + occluded, inliers, violations
    out[OCCLUDED], out[SHADED] = occluded, shaded
    out[SUM_A], out[SUM_B], out[SUM_AA], out[SUM_BB], out[SUM_AB] = a, b, aa, bb, ab
    return out


@numba.njit(cache=True, nogil=True)
def count_many(points, shades, T, near, far, detail, camera, tolerance, growth):  # type: ignore[no-untyped-def]
    """`count` for many poses (K, 4, 4): (K, 10)."""
    out = np.empty((len(T), 10))
    for k in range(len(T)):
        counts = count(points, shades, T[k], near, far, detail, camera, tolerance, growth)
        for what in range(len(counts)):  # an array into a row would compile for a second and a half
            out[k, what] = counts[what]
    return out


@numba.njit(cache=True, nogil=True)
def correlation(counts):  # type: ignore[no-untyped-def]
    """The normalised correlation -1..1 of the shades in ``counts (10,)``.

    0 with fewer than 30 of them or none that vary.
    """
    n = max(counts[SHADED], 1.0)
    a, b = counts[SUM_AA] - counts[SUM_A] ** 2 / n, counts[SUM_BB] - counts[SUM_B] ** 2 / n
    if counts[SHADED] < 30 or min(a, b) <= 1e-6 * n:
        return 0.0
    return (counts[SUM_AB] - counts[SUM_A] * counts[SUM_B] / n) / np.sqrt(a * b)
