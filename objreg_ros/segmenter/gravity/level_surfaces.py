# SPDX-License-Identifier: Apache-2.0
"""The direction of up: the cluster of surface normals that best agrees with a prior.

Floors, tables and shelves all share one normal, so their normals form the largest cluster near the expected direction,
even where no single plane dominates the frame. Up is minus gravity.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.sensor import CONFIDENCE

CANDIDATES = 64
CLUSTER = np.float32(np.cos(np.radians(8.0)))
RIVAL = np.float32(np.cos(np.radians(16.0)))
CONES = tuple(np.cos(np.radians((16.0, 12.0, 10.0, 8.0, 6.0, 6.0))).tolist())  # where a cluster's middle is sought
LEAST = CONFIDENCE[0]  # a guess that deserves less is none
ENOUGH = 0.10  # share of the normals that makes a cluster fully believed
MIN_NORMALS = 20


def camera_up(roll_deg: float) -> Array:
    """Up (3,) in the optical frame of a level camera that is mounted this far clockwise from upright."""
    roll = np.radians(roll_deg)
    return np.array([-np.sin(roll), -np.cos(roll), 0.0])


def estimate_up(normals: Array, prior: Array, cone_deg: float) -> tuple[Array | None, float]:
    """The direction up (3,) of length 1 in the camera frame and its confidence 0..1; (None, 0.0) if none is found.

    ``normals (N, 3)`` of length 1, towards the camera. Only clusters within ``cone_deg`` of ``prior`` count; each is
    weighed by the fourth power of the cosine to the prior. The confidence is what the cluster's weight leads the best
    other cluster by, less where only a small part of the frame is level; below `LEAST` there is no answer.
    """
    limit = np.float32(np.cos(np.radians(cone_deg)))
    up, confidence = _estimate(normals, prior.astype(np.float32), limit)
    return (up, confidence) if confidence >= LEAST else (None, 0.0)


@numba.njit(cache=True, nogil=True)
def _estimate(normals, prior, limit):  # type: ignore[no-untyped-def]
    """Up (3,) float64 and its confidence, 0 where there is none."""
    level, up = np.empty((3, len(normals)), np.float32), np.zeros(3)
    n = 0
    for k in range(len(normals)):
        if normals[k, 0] * prior[0] + normals[k, 1] * prior[1] + normals[k, 2] * prior[2] > limit:
            level[0, n], level[1, n], level[2, n] = normals[k, 0], normals[k, 1], normals[k, 2]
            n += 1
    if n < MIN_NORMALS:
        return up, 0.0
    level = level[:, :n]
    count, weight, best = np.empty(CANDIDATES), np.empty(CANDIDATES), 0
    for k in range(CANDIDATES):
        x, y, z = _candidate(level, k)
        count[k] = _count_near(level, x, y, z)
        cosine = max(x * prior[0] + y * prior[1] + z * prior[2], 0)
        weight[k] = count[k] * cosine * cosine * cosine * cosine
        best = k if weight[k] > weight[best] else best
    up[0], up[1], up[2] = _candidate(level, best)
    _refine(level, up)
    rival = 0.0
    for k in range(CANDIDATES):
        x, y, z = _candidate(level, k)
        if x * up[0] + y * up[1] + z * up[2] < RIVAL:
            rival = max(rival, weight[k])
    return up, (1.0 - rival / weight[best]) * min(1.0, count[best] / (ENOUGH * len(normals)))


@numba.njit(cache=True, nogil=True)
def _candidate(level, k):  # type: ignore[no-untyped-def]
    """The k-th of CANDIDATES normals, spread evenly over ``level (3, N)``."""
    n = k * (level.shape[1] - 1) // (CANDIDATES - 1)
    return level[0, n], level[1, n], level[2, n]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _count_near(level, x, y, z):  # type: ignore[no-untyped-def]
    """How many normals ``level (3, N)`` lie within the cone of a cluster around one."""
    total = 0
    n_x, n_y, n_z = level[0], level[1], level[2]
    for n in range(len(n_x)):
        total += 1 if x * n_x[n] + y * n_y[n] + z * n_z[n] > CLUSTER else 0
    return total


@numba.njit(cache=True, nogil=True, fastmath=True)
def _refine(level, up):  # type: ignore[no-untyped-def]
    """Turn ``up (3,)`` to the mean of the normals around it, in shrinking cones."""
    n_x, n_y, n_z = level[0], level[1], level[2]
    for cosine in CONES:
        x, y, z = 0.0, 0.0, 0.0
        for n in range(len(n_x)):
            near = n_x[n] * up[0] + n_y[n] * up[1] + n_z[n] * up[2] > cosine
            x += n_x[n] if near else 0.0
            y += n_y[n] if near else 0.0
            z += n_z[n] if near else 0.0
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0.0:  # a cone that no normal is in: the cluster is a ring
            break
        up[0], up[1], up[2] = x / length, y / length, z / length


def known_normals(normals: Array, stride: int) -> Array:
    """(N, 3) the normals that are known among every ``stride``-th one of ``normals (3, h, w)``."""
    _, h, w = normals.shape
    known = np.empty((-(-h // stride) * -(-w // stride), 3), np.float32)
    return known[: _gather_known(normals, stride, known)]


@numba.njit(cache=True, nogil=True)
def _gather_known(normals, stride, known):  # type: ignore[no-untyped-def]
    n = 0
    for i in range(0, normals.shape[1], stride):
        for j in range(0, normals.shape[2], stride):
            if normals[2, i, j] != 0:
                for k in range(3):
                    known[n, k] = normals[k, i, j]
                n += 1
    return n
