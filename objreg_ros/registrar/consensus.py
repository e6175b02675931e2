# SPDX-License-Identifier: Apache-2.0
"""Poses from putative matches of oriented points, by consensus of pairs: exhaustive, so it needs no luck and no seed.

Two matches fix a pose when a direction is known beside their baseline: gravity where both frames know it, the sum of
their normals otherwise. Every pair of matches that keeps its length, its tilt and its normals gives one pose, and
the pose is worth the weight of all matches that it brings together. This replaces RANSAC over triples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array


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
    most_pairs: int = 6000,
) -> tuple[tuple[Array, float], ...]:
    """The best distinct poses T_target_source with their support, best first, at most ``limit``.

    ``up_*`` are unit vectors against gravity or None; ``tolerance`` m of a match; ``shortest`` m of a baseline.
    Nothing comes back when no two matches agree.
    """
    upright = up_source is not None and up_target is not None
    ups = (up_source, up_target) if upright else (np.zeros(3), np.zeros(3))
    arrays = (matches.source, matches.target, matches.source_normals, matches.target_normals)
    pairs = _consistent_pairs(*arrays, *ups, upright, tolerance, shortest, most_pairs)  # type: ignore[call-arg]
    if len(pairs) == 0:
        return ()
    T, support = _supported_poses(*arrays, matches.weights, *ups, upright, tolerance, pairs)  # type: ignore[call-arg]
    middle = matches.source.mean(axis=0)
    chosen = distinct(T, support, middle, limit, angle=np.radians(6.0), distance=1.5 * tolerance)
    return tuple((T[k], float(support[k])) for k in chosen)


def distinct(T: Array, worth: Array, middle: Array, limit: int, angle: float, distance: float) -> list[int]:
    """Indices of the best poses (N, 4, 4) that differ by ``angle`` rad, or move ``middle (3,)`` by ``distance`` m."""
    order = np.argsort(-worth, kind="stable")
    centres = T[:, :3, :3] @ middle + T[:, :3, 3]
    return [int(k) for k in _distinct(T, centres, order, limit, np.cos(angle), distance)]


@numba.njit(cache=True, nogil=True)
def _distinct(T, centres, order, limit, cosine, distance):  # type: ignore[no-untyped-def]
    chosen = np.empty(limit, np.int64)
    n = 0
    for k in order:
        known = False
        for m in range(n):
            c = chosen[m]
            trace, gap = 0.0, 0.0
            for a in range(3):
                gap += (centres[c, a] - centres[k, a]) ** 2
                for b in range(3):
                    trace += T[c, a, b] * T[k, a, b]
            if gap < distance * distance and 0.5 * (trace - 1.0) > cosine:
                known = True
                break
        if not known:
            chosen[n] = k
            n += 1
            if n == limit:
                break
    return chosen[:n]


@numba.njit(cache=True, nogil=True, inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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
                if abs(hp - hq) > tolerance or lp * lp - hp * hp < 0.5 * shortest * shortest:
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


@numba.njit(cache=True, nogil=True)
def _frame(direction, axis):  # type: ignore[no-untyped-def]
    """A right-handed frame whose last column is along ``axis``, its first along what of ``direction`` is not."""
    R = np.empty((3, 3))
    z = axis / np.sqrt((axis * axis).sum())
    x = direction - (direction * z).sum() * z
    x = x / np.sqrt((x * x).sum() + 1e-18)
    R[:, 0] = x
    R[0, 1] = z[1] * x[2] - z[2] * x[1]
    R[1, 1] = z[2] * x[0] - z[0] * x[2]
    R[2, 1] = z[0] * x[1] - z[1] * x[0]
    R[:, 2] = z
    return R


@numba.njit(cache=True, nogil=True)
def _supported_poses(P, Q, N, M, weights, up_p, up_q, upright, tolerance, pairs):  # type: ignore[no-untyped-def]
    """The pose of each pair (K, 4, 4) and the weight of the matches that it brings together (K,)."""
    T = np.zeros((len(pairs), 4, 4))
    support = np.zeros(len(pairs))
    for k in range(len(pairs)):
        i, j = pairs[k]
        dp, dq = P[j] - P[i], Q[j] - Q[i]
        if upright:
            R = _frame(dq, up_q) @ _frame(dp, up_p).T
        else:  # the baseline is exact, the normals are not: they turn about it
            R = _frame(M[i] + M[j] + 1e-9, dq) @ _frame(N[i] + N[j] + 1e-9, dp).T
        t = 0.5 * (Q[i] + Q[j]) - R @ (0.5 * (P[i] + P[j]))
        T[k, :3, :3], T[k, :3, 3], T[k, 3, 3] = R, t, 1.0
        for m in range(len(P)):
            error = 0.0
            for a in range(3):
                r = R[a, 0] * P[m, 0] + R[a, 1] * P[m, 1] + R[a, 2] * P[m, 2] + t[a] - Q[m, a]
                error += r * r
            if error < tolerance * tolerance:
                support[k] += weights[m] * (1.0 - error / (tolerance * tolerance))
    return T, support
