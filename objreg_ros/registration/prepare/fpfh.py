# SPDX-License-Identifier: Apache-2.0
"""Local shape features: FPFH of Rusu, Blodow and Beetz, "Fast point feature histograms" (2009), and their matching.

A point's histogram (33 bins) says how the normals of its neighbours turn against its own. Everything is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("fpfh")
BINS = 11
MOST_CELLS = 4_000_000  # of the grid of neighbours


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
    histograms, crowd = _KERNELS.histograms(xyz, normals, *_cells(xyz, radius), np.float32(radius))
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
    forward, backward, ahead, behind = _KERNELS.nearest(source.histograms, np.ascontiguousarray(target.histograms.T))
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
    distance = np.sqrt(np.where(forward[a] == b, ahead[a], behind[b]))
    rank = salient * np.where(mutual, 2.0, 1.0) / (20.0 + distance)
    best = np.argsort(-rank, kind="stable")[:limit]
    return a[best], b[best], rank[best] / max(1e-9, float(rank.max()))


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
