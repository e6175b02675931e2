# SPDX-License-Identifier: Apache-2.0
"""Local shape features: FPFH of Rusu, Blodow and Beetz, "Fast point feature histograms" (2009), and their matching.

A point's histogram (33 bins) says how the normals of its neighbours turn against its own. Everything is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array

BINS = 11


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Features:
    """``xyz (N, 3)``, ``normals (N, 3)`` and ``histograms (N, 33)``, float32; ``saliency (N,)`` how unlike the rest."""

    xyz: Array
    normals: Array
    histograms: Array
    saliency: Array

    def __len__(self) -> int:
        return len(self.xyz)


def describe(xyz: Array, normals: Array, radius: float) -> Features:
    """The features of points (N, 3) with normals (N, 3); a point without a normal or with few neighbours drops out."""
    usable = np.abs(normals).sum(axis=1) > 0.5
    xyz = np.ascontiguousarray(xyz[usable], np.float32)
    normals = np.ascontiguousarray(normals[usable], np.float32)
    if len(xyz) == 0:
        return _features(xyz, normals, np.zeros((0, 3 * BINS), np.float32))
    order, first, low, shape = _cells(xyz, radius)
    histograms, crowd = _histograms(xyz, normals, order, first, low, shape, np.float32(radius))
    kept = crowd >= 5
    return _features(xyz[kept], normals[kept], histograms[kept])


def _features(xyz: Array, normals: Array, histograms: Array) -> Features:
    mean = histograms.mean(axis=0) if len(xyz) else np.zeros(3 * BINS, np.float32)
    saliency = np.abs(histograms - mean).sum(axis=1)
    return Features(xyz=xyz, normals=normals, histograms=histograms, saliency=saliency)


def match(source: Features, target: Features, limit: int) -> tuple[Array, Array, Array]:
    """The best partner of each salient point, asked both ways: indices into source and target, and a weight 0..1 each.

    At most ``limit`` matches, the most distinct first; partners of each other weigh twice what others do.
    """
    if min(len(source), len(target)) < 3:
        nothing = np.zeros(0, np.int64)
        return nothing, nothing, np.zeros(0)
    squared = _squared_distances(source.histograms, target.histograms)
    forward, backward = squared.argmin(axis=1), squared.argmin(axis=0)
    pairs = np.unique(
        np.concatenate(
            [
                np.stack([np.arange(len(source)), forward], axis=1),
                np.stack([backward, np.arange(len(target))], axis=1),
            ]
        ),
        axis=0,
    )
    a, b = pairs[:, 0], pairs[:, 1]
    mutual = (forward[a] == b) & (backward[b] == a)
    salient = np.minimum(source.saliency[a], target.saliency[b])
    rank = salient * np.where(mutual, 2.0, 1.0) / (20.0 + np.sqrt(squared[a, b]))
    best = np.argsort(-rank, kind="stable")[:limit]
    return a[best], b[best], rank[best] / max(1e-9, float(rank.max()))


def _squared_distances(a: Array, b: Array) -> Array:
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None] - 2.0 * (a @ b.T)
    return np.asarray(np.maximum(squared, 0.0))


@numba.njit(cache=True, nogil=True)
def _cells(xyz, size):  # type: ignore[no-untyped-def]
    """A sorted grid of cells with edge ``size``: (order, first point of each cell, low corner, cells per axis)."""
    low = np.empty(3, np.float32)
    shape = np.empty(3, np.int64)
    for k in range(3):
        low[k] = xyz[:, k].min()
        shape[k] = int((xyz[:, k].max() - low[k]) / size) + 1
    key = np.empty(len(xyz), np.int64)
    for i in range(len(xyz)):
        key[i] = (int((xyz[i, 0] - low[0]) / size) * shape[1] + int((xyz[i, 1] - low[1]) / size)) * shape[2] + int(
            (xyz[i, 2] - low[2]) / size
        )
    order = np.argsort(key, kind="mergesort")
    first = np.searchsorted(key[order], np.arange(shape[0] * shape[1] * shape[2] + 1))
    return order, first, low, shape


@numba.njit(cache=True, nogil=True, fastmath=True)
def _neighbours(xyz, i, order, first, low, shape, radius, found, squared):  # type: ignore[no-untyped-def]
    """Fill ``found`` and ``squared`` with the points within ``radius`` of point i but itself; returns how many."""
    n = 0
    a0 = int((xyz[i, 0] - low[0]) / radius)
    b0 = int((xyz[i, 1] - low[1]) / radius)
    c0 = int((xyz[i, 2] - low[2]) / radius)
    for a in range(max(0, a0 - 1), min(shape[0], a0 + 2)):
        for b in range(max(0, b0 - 1), min(shape[1], b0 + 2)):
            row = (a * shape[1] + b) * shape[2]
            for s in range(first[row + max(0, c0 - 1)], first[row + min(shape[2], c0 + 2)]):
                j = order[s]
                dx, dy, dz = xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], xyz[j, 2] - xyz[i, 2]
                d2 = dx * dx + dy * dy + dz * dz
                if j != i and 1e-10 < d2 <= radius * radius and n < len(found):
                    found[n], squared[n] = j, d2
                    n += 1
    return n


@numba.njit(cache=True, nogil=True, fastmath=True)
def _add_pair(p, n, q, m, distance, out):  # type: ignore[no-untyped-def]
    """Add the Darboux angles of two oriented points to the three histograms in ``out``."""
    d = (q - p) / distance
    a1 = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    a2 = m[0] * d[0] + m[1] * d[1] + m[2] * d[2]
    u, w, phi = n, m, a1
    if abs(a1) < abs(a2):  # the point whose normal is closer to the line is the source
        u, w, d, phi = m, n, -d, -a2
    v = np.array([d[1] * u[2] - d[2] * u[1], d[2] * u[0] - d[0] * u[2], d[0] * u[1] - d[1] * u[0]], np.float32)
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length < 1e-6:
        return
    v /= length
    x = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], np.float32)
    alpha = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
    theta = np.arctan2(x[0] * w[0] + x[1] * w[1] + x[2] * w[2], u[0] * w[0] + u[1] * w[1] + u[2] * w[2])
    out[min(10, int(11.0 * (theta + np.pi) / (2.0 * np.pi)))] += 1.0
    out[11 + max(0, min(10, int(11.0 * (alpha + 1.0) * 0.5)))] += 1.0
    out[22 + max(0, min(10, int(11.0 * (phi + 1.0) * 0.5)))] += 1.0


@numba.njit(cache=True, nogil=True, fastmath=True)
def _histograms(xyz, normals, order, first, low, shape, radius):  # type: ignore[no-untyped-def]
    """FPFH (N, 33), each of the three parts summing to 100, and the number of neighbours (N,)."""
    n = len(xyz)
    found, squared = np.empty(256, np.int64), np.empty(256, np.float32)
    simple = np.zeros((n, 33), np.float32)
    crowd = np.zeros(n, np.int64)
    for i in range(n):
        crowd[i] = _neighbours(xyz, i, order, first, low, shape, radius, found, squared)
        for s in range(crowd[i]):
            j = found[s]
            _add_pair(xyz[i], normals[i], xyz[j], normals[j], np.sqrt(squared[s]), simple[i])
        if crowd[i] > 0:
            simple[i] *= np.float32(100.0 / crowd[i])
    fast = np.zeros((n, 33), np.float32)
    for i in range(n):
        for s in range(_neighbours(xyz, i, order, first, low, shape, radius, found, squared)):
            weight = np.float32(1.0) / squared[s]
            for k in range(33):
                fast[i, k] += weight * simple[found[s], k]
        for part in range(3):
            total = np.float32(0.0)
            for k in range(11):
                total += fast[i, 11 * part + k]
            scale = np.float32(100.0) / max(total, np.float32(1e-9))
            own = np.float32(1.0) if total > 0 else np.float32(0.0)
            for k in range(11):
                fast[i, 11 * part + k] = own * scale * fast[i, 11 * part + k] + simple[i, 11 * part + k]
    return fast, crowd
