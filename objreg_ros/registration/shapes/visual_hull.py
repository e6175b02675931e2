# SPDX-License-Identifier: Apache-2.0
"""An upright motion is moved out of seen free space, until each shape lies within the visual hull of the other.

Two sides of an object that share no surface still locate it: what the one camera saw must fall inside the
outline that the other saw, or behind it. From a start that is decimetres off, where no point has a partner, each point
that floats beside an outline is drawn to its rim, each that floats before the surface, behind it. (Laurentini, "The
visual hull concept for silhouette-based image understanding", 1994.)
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.registration.kernels.least_squares import solve
from objreg_ros.registration.kernels.projection import FAST
from objreg_ros.registration.shapes.silhouette import BESIDE, INSIDE
from objreg_ros.registration.shapes.silhouette_score import tolerance_at

LARGEST_TURN, LARGEST_SHIFT = 0.3, 0.15  # rad and m in one step
KNEE = 0.02  # m: a point that floats farther pulls no harder, so that what one camera missed does not tear
BEFORE = 0.2  # weight of a point before the surface: it may as well belong beside it
DAMPING = (1.5, 30.0, 30.0)  # of yaw and the shifts: a few points that float move the shape by little


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def clear(source, target, motion, most, rounds):  # type: ignore[no-untyped-def]
    """Move ``motion (yaw, x, y, rise)`` in place, but for its rise, to where the first ``most`` points float least.

    ``source`` and ``target`` are `Shape.kernel_arrays`. Returns by how many metres, all together, they float there.
    """
    P, Rs, os, seen_s = source[0], source[3], source[4], (source[5], source[6], *source[8:])
    Q, Rt, ot, seen_t = target[0], target[3], target[4], (target[5], target[6], *target[8:])
    R, t, level, A, g = np.empty((3, 3)), np.empty(3), np.empty((3, 2)), np.empty((3, 3)), np.empty(3)
    best, kept = 1e9, motion.copy()
    for iteration in range(rounds + 1):
        c, s = np.cos(motion[0]), np.sin(motion[0])
        A[:], g[:] = 0.0, 0.0
        # upright source -> upright target -> target camera: Rt' (turn p + shift + ot)
        for k in range(3):
            a, b, d = Rt[0, k], Rt[1, k], Rt[2, k]
            R[k, 0], R[k, 1], R[k, 2] = a * c + b * s, b * c - a * s, d
            t[k] = a * (motion[1] + ot[0]) + b * (motion[2] + ot[1]) + d * (motion[3] + ot[2])
            level[k, 0], level[k, 1] = a, b
        floating = _pushes(P, most, R, t, seen_t, level, (c, s, 0.0, 0.0), A, g)
        # and back: Rs' (turn' (q - shift) + os)
        for k in range(3):
            a, b, d = Rs[0, k], Rs[1, k], Rs[2, k]
            R[k, 0], R[k, 1], R[k, 2] = a * c - b * s, a * s + b * c, d
            t[k] = a * os[0] + b * os[1] + d * (os[2] - motion[3]) - R[k, 0] * motion[1] - R[k, 1] * motion[2]
            level[k, 0], level[k, 1] = -R[k, 0], -R[k, 1]
        floating += _pushes(Q, most, R, t, seen_s, level, (1.0, 0.0, motion[1], motion[2]), A, g)
        if floating < best:
            best = floating
            kept[:] = motion
        if iteration == rounds or not _step(A, g, motion):
            break
    motion[:] = kept
    return best


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _step(A, g, motion):  # type: ignore[no-untyped-def]
    """Move ``motion`` by the damped step of its normal equations; whether it moved enough to go on."""
    A[1, 0], A[2, 0], A[2, 1] = A[0, 1], A[0, 2], A[1, 2]
    for k in range(3):
        A[k, k] += DAMPING[k]
    solve(A, g)
    motion[0] -= min(LARGEST_TURN, max(-LARGEST_TURN, g[0]))
    motion[1] -= min(LARGEST_SHIFT, max(-LARGEST_SHIFT, g[1]))
    motion[2] -= min(LARGEST_SHIFT, max(-LARGEST_SHIFT, g[2]))
    return abs(g[0]) > 1e-3 or abs(g[1]) + abs(g[2]) > 1e-3


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _pushes(P, most, R, t, seen, level, lever, A, g):  # type: ignore[no-untyped-def]
    """Add to the normal equations (A, g) of (yaw, x, y) what heals the points that float; returns how far they do.

    (R, t) is camera from points; ``level (3, 2)`` how the camera sees the two shifts; ``lever`` (c, s, x, y): yaw moves
    a point by its level place, turned by (c, s) and less (x, y).
    """
    depth, mask, camera, tolerance, inward, edges = seen
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    h, w = depth.shape
    per_pixel, total = 2.0 / (fx + fy), 0.0
    for i in range(min(most, len(P))):
        a, b, c = P[i, 0], P[i, 1], P[i, 2]
        z = R[2, 0] * a + R[2, 1] * b + R[2, 2] * c + t[2]
        if z < 0.1:
            continue
        x = (R[0, 0] * a + R[0, 1] * b + R[0, 2] * c + t[0]) / z
        y = (R[1, 0] * a + R[1, 1] * b + R[1, 2] * c + t[1]) / z
        u, v = fx * x + cx, fy * y + cy
        at_u, at_v = min(max(u, 0.0), w - 1.0), min(max(v, 0.0), h - 1.0)
        du, dv = at_u - u, at_v - v
        if (du > 0.0 and edges[0]) or (dv > 0.0 and edges[1]) or (du < -1.0 and edges[2]) or (dv < -1.0 and edges[3]):
            continue  # beyond the picture
        row, column = int(at_v), int(at_u)
        on, d = mask[row, column], depth[row, column]
        beyond = abs(du) + abs(dv) > 1.0
        if on == INSIDE and not beyond:  # before the surface?
            far, nx, ny, nz = d - z, 0.0, 0.0, 1.0
            if far < tolerance_at(z, tolerance):
                continue
        else:  # beside the outline, and not behind what is seen there?
            if (on != BESIDE and not beyond) or (d > 0.0 and z - d > tolerance_at(z, tolerance)):
                continue
            du, dv = du + inward[row, column, 0], dv + inward[row, column, 1]
            pixels = np.sqrt(du * du + dv * dv) + 1e-9
            far = pixels * z * per_pixel
            nx, ny = fx * per_pixel / pixels * du, fy * per_pixel / pixels * dv
            nz = -nx * x - ny * y
        along_x = nx * level[0, 0] + ny * level[1, 0] + nz * level[2, 0]
        along_y = nx * level[0, 1] + ny * level[1, 1] + nz * level[2, 1]
        left, ahead = lever[0] * a - lever[1] * b - lever[2], lever[1] * a + lever[0] * b - lever[3]
        turn = left * along_y - ahead * along_x
        weight = (BEFORE if on == INSIDE and not beyond else 1.0) / max(far, KNEE)
        A[0, 0] += weight * turn * turn
        A[0, 1] += weight * turn * along_x
        A[0, 2] += weight * turn * along_y
        A[1, 1] += weight * along_x * along_x
        A[1, 2] += weight * along_x * along_y
        A[2, 2] += weight * along_y * along_y
        for k, along in enumerate((turn, along_x, along_y)):
            g[k] -= weight * along * far
        total += far
    return total
