# SPDX-License-Identifier: Apache-2.0
"""Which way is up: the cluster of surface normals that best agrees with a prior.

Floors, tables and shelves all share one normal, so their normals form the largest cluster near the expected direction,
even where no single plane dominates the frame. Up is minus gravity.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array

CAMERA_UP = np.array([0.0, -1.0, 0.0])  # of an upright camera in its optical frame
CANDIDATES = 96
CLUSTER = np.cos(np.radians(8.0))
ENOUGH = 0.10  # share of the normals that makes a cluster fully believed
MIN_NORMALS = 60


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
    count = (candidates @ level.T > CLUSTER).sum(axis=1)
    weight = count * np.clip(candidates @ prior.astype(level.dtype), 0, 1) ** 4
    best = int(weight.argmax())
    up = _refine(level, candidates[best])
    rivals = weight[candidates @ up.astype(level.dtype) < np.cos(np.radians(16.0))]
    lead = 1.0 - float(rivals.max(initial=0.0) / weight[best])
    return up, lead * min(1.0, float(count[best]) / (ENOUGH * len(normals)))


def _refine(normals: Array, up: Array) -> Array:
    """The mean of the normals around ``up``, in shrinking cones."""
    for cone_deg in (10.0, 8.0, 6.0, 6.0):
        mean = normals[normals @ up > np.cos(np.radians(cone_deg))].mean(axis=0)
        up = mean / np.linalg.norm(mean)
    return up.astype(np.float64) / np.linalg.norm(up.astype(np.float64))
