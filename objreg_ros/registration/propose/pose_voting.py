# SPDX-License-Identifier: Apache-2.0
"""Poses from putative matches of oriented points, by consensus of pairs: exhaustive, so it needs no luck and no seed.

Two matches fix a pose when a direction is known beside their baseline: gravity where both frames know it, the sum of
their normals otherwise. Every pair of matches that keeps its length, its tilt and its normals gives one pose, and
the pose is scored by the weight of all matches that it brings together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.projection import FAST
from objreg_ros.registration.kernels.same_pose import VOTES_ANGLE, VOTES_TOLERANCES, Nearness, distinct

MOST_PAIRS = 4000  # of matches that agree, each of which gives a pose to weigh
ASIDE = 1e-8  # the square of 0.1 mm: a baseline that is no farther aside of its direction fixes no pose with it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """M putative matches: points and normals (M, 3) float64 in source and target, 0 0 0 if unknown; weights (M,)."""

    source: Array
    target: Array
    source_normals: Array
    target_normals: Array
    weights: Array

    def __len__(self) -> int:
        return len(self.weights)


def poses(
    matches: Matches,
    up_source: Array | None,
    up_target: Array | None,
    tolerance: float,
    shortest: float,
    limit: int,
) -> tuple[tuple[Array, float], ...]:
    """The best distinct poses T_target_source with their support, best first, at most ``limit``.

    ``up_*`` are unit vectors against gravity or None; ``tolerance`` m of a match; ``shortest`` m of a baseline.
    Nothing comes back when no two matches agree.
    """
    upright = up_source is not None and up_target is not None
    ups = (up_source, up_target) if upright else (np.zeros(3), np.zeros(3))
    arrays = (matches.source, matches.target, matches.source_normals, matches.target_normals)
    pairs = _consistent_pairs(*arrays, *ups, upright, tolerance, shortest, MOST_PAIRS)  # type: ignore[call-arg]
    if len(pairs) == 0:
        return ()
    T = _poses(*arrays, *ups, upright, pairs)  # type: ignore[call-arg]
    columns = (np.ascontiguousarray(part.T, np.float32) for part in (matches.source, matches.target, matches.weights))
    support = _support(*columns, T.astype(np.float32), np.float32(tolerance))  # type: ignore[call-arg]
    middle = matches.source.mean(axis=0)
    chosen = distinct(T, support, middle, limit, Nearness(VOTES_ANGLE, VOTES_TOLERANCES * tolerance))
    return tuple((T[k], float(support[k])) for k in chosen)


@numba.njit(cache=True, nogil=True, inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True, nogil=True, inline="always")
def _aside(n, m, baseline, length):  # type: ignore[no-untyped-def]
    """The square of how far the sum of two normals is aside of a baseline; 0 where that has no length."""
    if length == 0.0:
        return 0.0
    along = (_dot(n, baseline) + _dot(m, baseline)) / length
    return _dot(n, n) + 2.0 * _dot(n, m) + _dot(m, m) - along * along


@numba.njit(cache=True, nogil=True)
def _consistent_pairs(P, Q, N, M, up_p, up_q, upright, tolerance, shortest, most):  # type: ignore[no-untyped-def]
    """Pairs (K, 2) of matches that one rigid motion can explain, from the best ones on, at most ``most``."""
    found = np.empty((most, 2), np.int64)
    known = np.empty(len(P), np.bool_)
    for i in range(len(P)):
        known[i] = _dot(N[i], N[i]) > 0.5 and _dot(M[i], M[i]) > 0.5
    dp, dq = np.empty(3), np.empty(3)
    n = 0
    for j in range(1, len(P)):
        for i in range(j):
            for k in range(3):
                dp[k], dq[k] = P[j, k] - P[i, k], Q[j, k] - Q[i, k]
            lp, lq = np.sqrt(_dot(dp, dp)), np.sqrt(_dot(dq, dq))
            if lp < shortest or abs(lp - lq) > tolerance:
                continue
            if upright:
                hp, hq = _dot(dp, up_p), _dot(dq, up_q)
                if (
                    abs(hp - hq) > tolerance
                    or lp * lp - hp * hp < 0.5 * shortest * shortest
                    or lq * lq - hq * hq < ASIDE
                ):
                    continue
            elif min(_aside(N[i], N[j], dp, lp), _aside(M[i], M[j], dq, lq)) < ASIDE:
                continue
            if known[i] and known[j]:
                if (
                    abs(_dot(N[i], N[j]) - _dot(M[i], M[j])) > 0.25
                    or abs(_dot(N[i], dp) / lp - _dot(M[i], dq) / lq) > 0.25
                    or abs(_dot(N[j], dp) / lp - _dot(M[j], dq) / lq) > 0.25
                ):
                    continue
            elif not upright:
                continue
            found[n, 0], found[n, 1] = i, j
            n += 1
            if n == most:
                return found
    return found[:n]


@numba.njit(cache=True, nogil=True, inline="always")
def _axes(direction, axis):  # type: ignore[no-untyped-def]
    """A right-handed frame: its third axis along ``axis``, its first along what of ``direction`` is not."""
    z = np.sqrt(_dot(axis, axis)) + 1e-18
    zx, zy, zz = axis[0] / z, axis[1] / z, axis[2] / z
    along = direction[0] * zx + direction[1] * zy + direction[2] * zz
    x, y, w = direction[0] - along * zx, direction[1] - along * zy, direction[2] - along * zz
    n = np.sqrt(x * x + y * y + w * w) + 1e-9
    x, y, w = x / n, y / n, w / n
    return (x, y, w), (zy * w - zz * y, zz * x - zx * w, zx * y - zy * x), (zx, zy, zz)


@numba.njit(cache=True, nogil=True)
def _turn(from_direction, from_axis, to_direction, to_axis, R):  # type: ignore[no-untyped-def]
    """Fill ``R`` (3, 3) with the rotation that takes an axis and, about it, a direction to others."""
    a, b = _axes(from_direction, from_axis), _axes(to_direction, to_axis)
    for r in range(3):
        for c in range(3):
            R[r, c] = b[0][r] * a[0][c] + b[1][r] * a[1][c] + b[2][r] * a[2][c]


@numba.njit(cache=True, nogil=True)
def _poses(P, Q, N, M, up_p, up_q, upright, pairs):  # type: ignore[no-untyped-def]
    """The pose (K, 4, 4) of each pair of matches."""
    T = np.zeros((len(pairs), 4, 4))
    dp, dq, n, m = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(pairs)):
        i, j = pairs[k]
        for a in range(3):
            dp[a], dq[a] = P[j, a] - P[i, a], Q[j, a] - Q[i, a]
            n[a], m[a] = N[i, a] + N[j, a] + 1e-9, M[i, a] + M[j, a] + 1e-9
        R = T[k]
        if upright:
            _turn(dp, up_p, dq, up_q, R)
        else:  # the baseline is exact, the normals are not: they turn about it
            _turn(n, dp, m, dq, R)
        for a in range(3):
            R[a, 3] = 0.5 * (Q[i, a] + Q[j, a])
            for b in range(3):
                R[a, 3] -= R[a, b] * 0.5 * (P[i, b] + P[j, b])
        R[3, 3] = 1.0
    return T


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _support(P, Q, weights, T, tolerance):  # type: ignore[no-untyped-def]
    """The weight of the matches, columns (3, M) float32, that each pose (K, 4, 4) float32 brings together.

    Without branches, so that it runs in lanes.
    """
    support = np.zeros(len(T))
    px, py, pz, qx, qy, qz = P[0], P[1], P[2], Q[0], Q[1], Q[2]
    scale, nothing, one = np.float32(1.0) / (tolerance * tolerance), np.float32(0.0), np.float32(1.0)
    for k in range(len(T)):
        r00, r01, r02, tx = T[k, 0, 0], T[k, 0, 1], T[k, 0, 2], T[k, 0, 3]
        r10, r11, r12, ty = T[k, 1, 0], T[k, 1, 1], T[k, 1, 2], T[k, 1, 3]
        r20, r21, r22, tz = T[k, 2, 0], T[k, 2, 1], T[k, 2, 2], T[k, 2, 3]
        total = nothing
        for m in range(len(weights)):
            x = r00 * px[m] + r01 * py[m] + r02 * pz[m] + tx - qx[m]
            y = r10 * px[m] + r11 * py[m] + r12 * pz[m] + ty - qy[m]
            z = r20 * px[m] + r21 * py[m] + r22 * pz[m] + tz - qz[m]
            total += weights[m] * max(nothing, one - scale * (x * x + y * y + z * z))
        support[k] = total
    return support
