# SPDX-License-Identifier: Apache-2.0
"""Local shape features: FPFH of Rusu, Blodow and Beetz, "Fast point feature histograms" (2009), and their matching.

A point's histogram (33 bins) says how the normals of its neighbours turn against its own. Everything is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.projection import FAST

BINS = 11
CROWD = 256  # most neighbours of a point
MOST_CELLS = 4_000_000  # of the grid of neighbours
FAR = 1e30  # a squared distance beyond all


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
    histograms, crowd = _histograms(xyz, normals, *_cells(xyz, radius), np.float32(radius))
    kept = crowd >= 5
    return _features(xyz[kept], normals[kept], histograms[kept])


def _features(xyz: Array, normals: Array, histograms: Array) -> Features:
    mean = histograms.mean(axis=0) if len(xyz) else np.zeros(3 * BINS, np.float32)
    saliency = np.abs(histograms - mean).sum(axis=1)
    return Features(xyz=xyz, normals=normals, histograms=histograms, saliency=saliency)


def salient(features: Features, most: int) -> Features:
    """The most salient of them, in their order; matching takes the product of both numbers."""
    if len(features) <= most:
        return features
    kept = np.sort(np.argpartition(-features.saliency, most)[:most])
    return Features(
        xyz=features.xyz[kept],
        normals=features.normals[kept],
        histograms=features.histograms[kept],
        saliency=features.saliency[kept],
    )


def match(source: Features, target: Features, limit: int) -> tuple[Array, Array, Array]:
    """The best partner of each salient point, asked both ways: indices into source and target, and a weight 0..1 each.

    At most ``limit`` matches, the most distinct first; partners of each other weigh twice what others do.
    """
    if min(len(source), len(target)) < 3:
        nothing = np.zeros(0, np.int64)
        return nothing, nothing, np.zeros(0)
    forward, backward, squared = _nearest(source.histograms, np.ascontiguousarray(target.histograms.T))
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
    distance = np.sqrt(np.where(forward[a] == b, squared[0][a], squared[1][b]))
    rank = salient * np.where(mutual, 2.0, 1.0) / (20.0 + distance)
    best = np.argsort(-rank, kind="stable")[:limit]
    return a[best], b[best], rank[best] / max(1e-9, float(rank.max()))


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _nearest(a, b):  # type: ignore[no-untyped-def]
    """The nearest partner of each of N and each of M histograms, ``a (N, K)`` and ``b (K, M)``, in one pass.

    With the squared distances to them: (N,), (M,), ((N,), (M,)). Not by BLAS, whose own threads wait for each other
    and spin meanwhile, while two places are tried at once.
    """
    n, m = len(a), b.shape[1]
    forward, backward = np.zeros(n, np.int64), np.zeros(m, np.int64)
    ahead, behind = np.full(n, np.float32(FAR)), np.full(m, np.float32(FAR))
    squared = np.empty(m, np.float32)
    for i in range(n):
        squared[:] = np.float32(0.0)
        for k in range(len(b)):
            own = a[i, k]
            for j in range(m):
                squared[j] += (own - b[k, j]) * (own - b[k, j])
        best, where = np.float32(FAR), 0
        for j in range(m):
            if squared[j] < best:
                best, where = squared[j], j
            if squared[j] < behind[j]:
                behind[j], backward[j] = squared[j], i
        ahead[i], forward[i] = best, where
    return forward, backward, (ahead, behind)


def _cells(xyz: Array, size: float) -> tuple[Array, Array, Array, Array, np.float32]:
    """A sorted grid of cells: (order, first point of each cell, low corner, cells per axis, edge of a cell).

    The edge is ``size``, and more where points lie so far apart that there would be too many cells.
    """
    low, extent = xyz.min(axis=0), np.ptp(xyz, axis=0).astype(float)
    while np.prod(extent / size + 1.0) > MOST_CELLS:
        size *= 1.25
    cell = ((xyz - low) / np.float32(size)).astype(np.int64)
    shape = cell.max(axis=0) + 1
    key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    return order, np.searchsorted(key[order], np.arange(np.prod(shape) + 1)), low, shape, np.float32(size)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _neighbours(xyz, i, order, first, low, shape, cell, radius, found, squared):  # type: ignore[no-untyped-def]
    """Fill ``found`` and ``squared`` with the points within ``radius`` of point i but itself; returns how many."""
    n = 0
    a0 = int((xyz[i, 0] - low[0]) / cell)
    b0 = int((xyz[i, 1] - low[1]) / cell)
    c0 = int((xyz[i, 2] - low[2]) / cell)
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


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _angle(y, x):  # type: ignore[no-untyped-def]
    """The angle of (x, y) in rad, to 3e-4: a bin is two thousand times as wide."""
    a, b = abs(x), abs(y)
    slope = min(a, b) / max(a, b, np.float32(1e-12))
    q = slope * slope
    angle = ((np.float32(-0.0464965) * q + np.float32(0.1593142)) * q - np.float32(0.3276228)) * q * slope + slope
    if b > a:
        angle = np.float32(0.5 * np.pi) - angle
    if x < 0:
        angle = np.float32(np.pi) - angle
    return -angle if y < 0 else angle


@numba.njit(cache=True, nogil=True, fastmath=FAST, inline="always")
def _bins(p, n, q, m, distance):  # type: ignore[no-untyped-def]
    """The bins (of 11 each) of the three Darboux angles of two oriented points, the same from either side.

    The first is -1 where the angles are not defined.
    """
    x, y, z = (q[0] - p[0]) / distance, (q[1] - p[1]) / distance, (q[2] - p[2]) / distance
    a, b = n[0] * x + n[1] * y + n[2] * z, m[0] * x + m[1] * y + m[2] * z
    u, w, phi = n, m, a
    if abs(a) < abs(b):  # the point whose normal is closer to the line is the source
        u, w, x, y, z, phi = m, n, -x, -y, -z, -b
    vx, vy, vz = y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]
    length = np.sqrt(vx * vx + vy * vy + vz * vz)
    if length < 1e-6:
        return -1, 0, 0
    alpha = (vx * w[0] + vy * w[1] + vz * w[2]) / length
    sine = (u[1] * vz - u[2] * vy) * w[0] + (u[2] * vx - u[0] * vz) * w[1] + (u[0] * vy - u[1] * vx) * w[2]
    theta = _angle(sine / length, u[0] * w[0] + u[1] * w[1] + u[2] * w[2])
    return (
        min(10, int(11.0 * (theta + np.pi) / (2.0 * np.pi))),
        max(0, min(10, int(11.0 * (alpha + 1.0) * 0.5))),
        max(0, min(10, int(11.0 * (phi + 1.0) * 0.5))),
    )


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _histograms(xyz, normals, order, first, low, shape, cell, radius):  # type: ignore[no-untyped-def]
    """FPFH (N, 33), each of the three parts summing to 100, and the number of neighbours (N,)."""
    n = len(xyz)
    found, squared = np.empty((n, CROWD), np.int32), np.empty((n, CROWD), np.float32)
    simple = np.zeros((n, 3 * BINS), np.float32)
    crowd = np.zeros(n, np.int64)
    for i in range(n):
        crowd[i] = _neighbours(xyz, i, order, first, low, shape, cell, radius, found[i], squared[i])
    for i in range(n):
        for s in range(crowd[i]):
            j = found[i, s]
            mutual = crowd[j] < CROWD and crowd[i] < CROWD  # a full list may lack the other
            if mutual and j < i:
                continue  # the other one has added it to both
            a, b, c = _bins(xyz[i], normals[i], xyz[j], normals[j], np.sqrt(squared[i, s]))
            if a < 0:
                continue
            for k in range(2 if mutual else 1):
                owner = j if k else i
                simple[owner, a] += 1.0
                simple[owner, BINS + b] += 1.0
                simple[owner, 2 * BINS + c] += 1.0
    for i in range(n):
        scale = np.float32(100.0 / max(1, crowd[i]))
        for k in range(3 * BINS):
            simple[i, k] *= scale
    return _weighted(simple, found, squared, crowd), crowd


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _weighted(simple, found, squared, crowd):  # type: ignore[no-untyped-def]
    """Each histogram with those of its neighbours, the near ones most."""
    fast = np.zeros_like(simple)
    for i in range(len(simple)):
        for s in range(crowd[i]):
            weight, j = np.float32(1.0) / squared[i, s], found[i, s]
            for k in range(3 * BINS):
                fast[i, k] += weight * simple[j, k]
        for part in range(3):
            total = np.float32(0.0)
            for k in range(BINS):
                total += fast[i, BINS * part + k]
            scale = np.float32(100.0) / max(total, np.float32(1e-9))
            own = np.float32(1.0) if total > 0 else np.float32(0.0)
            for k in range(BINS):
                fast[i, BINS * part + k] = own * scale * fast[i, BINS * part + k] + simple[i, BINS * part + k]
    return fast
