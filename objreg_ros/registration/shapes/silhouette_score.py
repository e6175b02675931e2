# SPDX-License-Identifier: Apache-2.0
"""How well two shapes agree under an upright motion: the two-way visibility score on their silhouettes.

A point on the other's surface counts for a motion. One that floats in seen free space, beside the silhouette or before
it, counts a dozen times as much against it. One that is hidden counts little. The grey separates the sides of an
object: where both are textured it should correlate, and if it does not, that counts against the motion too.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.kernels.projection import FAST, INDEX, LEAST_DEPTH, project
from objreg_ros.registration.shapes.shape import Shape
from objreg_ros.registration.shapes.silhouette import INSIDE, RIM
from objreg_ros.sensor import NEAR_M

_KERNELS = kernels("silhouette_score")
ask, climb, tally = _KERNELS.ask, _KERNELS.climb, _KERNELS.tally
VIOLATION_WEIGHT = 12.0  # of an object's points in seen free space
OCCLUSION_WEIGHT = 0.6  # of an object's points behind what was seen
RESIDUAL_WEIGHT = 1.2  # of squared distances from what was seen
GREY_WEIGHT = 3.0  # of the correlation of grey
GREY_NEUTRAL = 0.3  # correlation of grey that says nothing
GREY_NOISE = 12.0  # standard deviation of grey that is noise, in grey levels

# What `tally` counts.
INLIERS, VIOLATIONS, HIDDEN, RESIDUAL, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB = range(10)
COUNTS = 10
LEAST_SHADED = 20
STEPS = 8  # rounds of a climb to what is nearby, each a step of that share of its reach at most


def weights_of() -> Array:
    """(6,): of free-space violations, hidden points, squared residuals and grey; expected correlation, grey's noise."""
    return np.array(
        [
            VIOLATION_WEIGHT,
            OCCLUSION_WEIGHT,
            RESIDUAL_WEIGHT,
            GREY_WEIGHT,
            GREY_NEUTRAL,
            GREY_NOISE**2,
        ]
    )


def score_silhouettes(source: Shape, target: Shape, motion: Array, reach: float = 0.0) -> float:
    """The score of a motion (yaw, x, y, rise): near 1 and more if right, below 0 if the cameras saw otherwise.

    The best that a climb finds within ``reach`` m along each axis, height too, turned as much.
    """
    extent, most = 0.5 * (source.extent + target.extent), source.most + target.most
    steps = np.array([0.0, reach, reach, reach]) / STEPS
    return float(
        climb(source.kernel_arrays, target.kernel_arrays, motion.copy(), extent, weights_of(), most, steps, STEPS)
    )


# Once more, for the kernels of total_score.py.
@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _tolerance_at(z, tolerance):  # type: ignore[no-untyped-def]
    """How far two depths of one surface may differ at a depth z, m: `Silhouette.tolerance`."""
    return tolerance[0] + tolerance[1] * (z - NEAR_M) * (z - NEAR_M)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _tally(P, N, S, most, T, depth, mask, grey, camera, tolerance, extent, out):  # type: ignore[no-untyped-def]
    """Add to ``out (10,)`` what a silhouette says of the first ``most`` points under T (3, 4), camera from points."""
    height, width = depth.shape
    us, vs, zs = project(P[:most], T, camera)
    for i in range(len(us)):
        u, v, z = us[i], vs[i], zs[i]
        if not ((z >= LEAST_DEPTH) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height)):
            continue
        row, column = INDEX(v), INDEX(u)
        d = depth[row, column]
        if d <= 0.0:
            continue
        on = mask[row, column]
        within = _tolerance_at(z, tolerance)
        e = z - d
        if e < -within:
            if on != RIM:
                out[VIOLATIONS] += 1.0
        elif e > within:
            out[HIDDEN] += min(1.0, max(0.0, e / extent - 0.5)) if on == INSIDE else 0.5
        elif on != 0 and _faces(T, N[i], (u - camera[2]) / camera[0], (v - camera[3]) / camera[1]):
            out[INLIERS] += 1.0
            out[RESIDUAL] += e * e / (within * within)
            if on == INSIDE:
                f, g = S[i], grey[row, column]
                out[SHADED] += 1.0
                out[SUM_A] += f
                out[SUM_B] += g
                out[SUM_AA] += f * f
                out[SUM_BB] += g * g
                out[SUM_AB] += f * g
    return len(us)


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _faces(T, normal, x, y):  # type: ignore[no-untyped-def]
    """Whether a normal that is turned by T looks back along the ray (x, y, 1)."""
    a, b, c = normal[0], normal[1], normal[2]
    along_x = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
    along_y = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
    return along_x * x + along_y * y + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c < 0.0


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _rated(out, n, weights):  # type: ignore[no-untyped-def]
    """The score of a tally of n points; `weights_of` says what the weights are."""
    violated, hidden, residual, grey, expected, noise = weights
    m = max(out[SHADED], 1.0)
    aa = max(0.0, out[SUM_AA] / m - (out[SUM_A] / m) ** 2)
    bb = max(0.0, out[SUM_BB] / m - (out[SUM_B] / m) ** 2)
    ab = out[SUM_AB] / m - out[SUM_A] / m * out[SUM_B] / m
    correlated = (ab - expected * np.sqrt(aa * bb)) / np.sqrt((aa + noise) * (bb + noise))
    painted = grey * correlated if out[SHADED] >= LEAST_SHADED else 0.0
    against = residual * out[RESIDUAL] + violated * out[VIOLATIONS] + hidden * out[HIDDEN]
    return (out[INLIERS] * (1.0 + painted) - against) / n


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _ask(source, target, motion, extent, most, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` with what both cameras say of a motion (yaw, x, y, rise); returns how many points were asked."""
    P, N, S, Rs, os, depth_s, mask_s, grey_s, camera_s, tolerance_s, _, _ = source
    Q, M, G, Rt, ot, depth_t, mask_t, grey_t, camera_t, tolerance_t, _, _ = target
    c, s = np.cos(motion[0]), np.sin(motion[0])
    T = np.empty((3, 4))
    out[:] = 0.0
    # upright source -> upright target -> target camera: Rt' (turn p + shift + ot)
    for k in range(3):
        a, b, d = Rt[0, k], Rt[1, k], Rt[2, k]
        T[k, 0], T[k, 1], T[k, 2] = a * c + b * s, b * c - a * s, d
        T[k, 3] = a * (motion[1] + ot[0]) + b * (motion[2] + ot[1]) + d * (motion[3] + ot[2])
    n = _tally(P, N, S, most, T, depth_t, mask_t, grey_t, camera_t, tolerance_t, extent, out)
    # and back: Rs' (turn' (q - shift) + os)
    for k in range(3):
        a, b, d = Rs[0, k], Rs[1, k], Rs[2, k]
        T[k, 0], T[k, 1], T[k, 2] = a * c - b * s, a * s + b * c, d
        T[k, 3] = a * os[0] + b * os[1] + d * (os[2] - motion[3]) - T[k, 0] * motion[1] - T[k, 1] * motion[2]
    return n + _tally(Q, M, G, most, T, depth_s, mask_s, grey_s, camera_s, tolerance_s, extent, out)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def two_way(source, target, motion, extent, weights, most):  # type: ignore[no-untyped-def]
    """The score of a motion (yaw, x, y, rise), asked of both cameras."""
    out = np.empty(COUNTS)
    n = _ask(source, target, motion, extent, most, out)
    return _rated(out, n, weights)
