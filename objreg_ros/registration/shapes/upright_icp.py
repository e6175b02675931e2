# SPDX-License-Identifier: Apache-2.0
"""A robust point-to-plane ICP of an upright motion: yaw and two level shifts, on a closest-point grid."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.registration.kernels.least_squares import solve
from objreg_ros.registration.kernels.projection import FAST

COMPATIBLE = 0.5  # cosine between the normals of a pair
LARGEST_TURN = 0.3  # rad in one step
POINTWISE = 0.005  # weight of point-to-point error beside it: holds what slides along a plane


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def settle(P, N, most, surface, motion, reach, last_reach, iterations):  # type: ignore[no-untyped-def]
    """Move ``motion (yaw, x, y, rise)`` in place, but for its rise, to the surface; returns how many pairs it found.

    ``surface`` is (xyz, normals, closest, low, cell); pairs lie within ``reach`` m at first and ``last_reach`` at last.
    """
    Q, M, closest, low, cell = surface
    reach_shrink = last_reach / reach
    n, pairs = min(most, len(P)), 0
    A = np.empty((3, 3))
    g = np.empty(3)
    for iteration in range(iterations):
        limit = reach * reach_shrink ** (iteration / max(1, iterations - 1))
        c, s = np.cos(motion[0]), np.sin(motion[0])
        A[:], g[:] = 0.0, 0.0
        pairs = 0
        for i in range(n):
            rx, ry = c * P[i, 0] - s * P[i, 1], s * P[i, 0] + c * P[i, 1]
            x, y, z = rx + motion[1], ry + motion[2], P[i, 2] + motion[3]
            if x < low[0] or y < low[1] or z < low[2]:
                continue
            a, b, e = int((x - low[0]) / cell), int((y - low[1]) / cell), int((z - low[2]) / cell)
            if a >= closest.shape[0] or b >= closest.shape[1] or e >= closest.shape[2]:
                continue
            j = closest[a, b, e]
            if j < 0:
                continue
            mx, my, mz = M[j, 0], M[j, 1], M[j, 2]
            if (c * N[i, 0] - s * N[i, 1]) * mx + (s * N[i, 0] + c * N[i, 1]) * my + N[i, 2] * mz < COMPATIBLE:
                continue
            dx, dy, dz = x - Q[j, 0], y - Q[j, 1], z - Q[j, 2]
            squared = (dx * dx + dy * dy + dz * dz) / (limit * limit)
            if squared > 1.0:
                continue
            w = (1.0 - squared) * (1.0 - squared)
            v = w * POINTWISE
            r = mx * dx + my * dy + mz * dz
            turn = my * rx - mx * ry
            A[0, 0] += w * turn * turn + v * (rx * rx + ry * ry)
            A[0, 1] += w * turn * mx - v * ry
            A[0, 2] += w * turn * my + v * rx
            A[1, 1] += w * mx * mx + v
            A[1, 2] += w * mx * my
            A[2, 2] += w * my * my + v
            g[0] += w * turn * r + v * (rx * dy - ry * dx)
            g[1] += w * mx * r + v * dx
            g[2] += w * my * r + v * dy
            pairs += 1
        if pairs < 6:
            break
        A[1, 0], A[2, 0], A[2, 1] = A[0, 1], A[0, 2], A[1, 2]
        A[0, 0] += 1e-6 + 1e-4 * A[0, 0]
        A[1, 1] += 1e-3
        A[2, 2] += 1e-3
        solve(A, g)
        motion[0] -= min(LARGEST_TURN, max(-LARGEST_TURN, g[0]))
        motion[1] -= g[1]
        motion[2] -= g[2]
        if iteration > 3 and abs(g[0]) < 1e-4 and abs(g[1]) + abs(g[2]) < 2e-5:
            break
    return pairs
