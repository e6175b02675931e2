# SPDX-License-Identifier: Apache-2.0
"""Which way is up: the cluster of surface normals that best agrees with a prior.

Floors, tables and shelves all share one normal, so their normals form the largest cluster near the expected direction,
even where no single plane dominates the frame. Up is minus gravity.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data import Array

CAMERA_UP = np.array([0.0, -1.0, 0.0])  # of an upright camera in its optical frame
CANDIDATES = 64
CLUSTER = np.float32(np.cos(np.radians(8.0)))
RIVAL = np.float32(np.cos(np.radians(16.0)))
ENOUGH = 0.10  # share of the normals that makes a cluster fully believed
MIN_NORMALS = 20


def estimate_up(normals: Array, prior: Array, cone_deg: float) -> tuple[Array | None, float]:
    """The direction up (3,) of length 1 in the camera frame and its confidence 0..1; (None, 0.0) if nothing tells it.

    ``normals (N, 3)`` of length 1, towards the camera. Only clusters within ``cone_deg`` of ``prior`` count; each is
    weighed by the fourth power of the cosine to the prior. The confidence is what the cluster's weight leads the best
    other cluster by, less where only a small part of the frame is level.
    """
    cosine = normals @ prior.astype(normals.dtype)
    level = normals[cosine > np.cos(np.radians(cone_deg))]
    if len(level) < MIN_NORMALS:
        return None, 0.0
    candidates = level[np.linspace(0, len(level) - 1, CANDIDATES).astype(int)]
    count = np.empty(len(candidates), np.int64)
    _count_near(candidates, np.ascontiguousarray(level.T), CLUSTER, count)
    weight = count * np.clip(candidates @ prior.astype(level.dtype), 0, 1) ** 4
    best = int(weight.argmax())
    up = _refine(level, candidates[best])
    rivals = weight[candidates @ up.astype(level.dtype) < RIVAL]
    lead = 1.0 - float(rivals.max(initial=0.0) / weight[best])
    return up, lead * min(1.0, float(count[best]) / (ENOUGH * len(normals)))


def _refine(normals: Array, up: Array) -> Array:
    """The mean of the normals around ``up``, in shrinking cones."""
    for cone_deg in (10.0, 8.0, 6.0, 6.0):
        mean = normals[normals @ up > np.cos(np.radians(cone_deg))].mean(axis=0)
        up = mean / np.linalg.norm(mean)
    return up.astype(np.float64) / np.linalg.norm(up.astype(np.float64))


def known_normals(normals: Array, stride: int) -> Array:
    """(N, 3) the normals that are known among every ``stride``-th one of ``normals (3, h, w)``."""
    _, h, w = normals.shape
    known = np.empty((-(-h // stride) * -(-w // stride), 3), np.float32)
    return known[: _gather_known(normals, stride, known)]


@numba.njit(cache=True)
def _gather_known(normals, stride, known):  # type: ignore[no-untyped-def]
    n = 0
    for i in range(0, normals.shape[1], stride):
        for j in range(0, normals.shape[2], stride):
            if normals[2, i, j] != 0:
                for k in range(3):
                    known[n, k] = normals[k, i, j]
                n += 1
    return n


@numba.njit(cache=True, fastmath=True)
def _count_near(candidates, normals, cosine, count):  # type: ignore[no-untyped-def]
    """How many ``normals (3, N)`` lie within the cone of each candidate (K, 3)."""
    for k in range(len(candidates)):
        x, y, z = candidates[k]
        total = 0
        for n in range(normals.shape[1]):
            total += 1 if x * normals[0, n] + y * normals[1, n] + z * normals[2, n] > cosine else 0
        count[k] = total
