# SPDX-License-Identifier: Apache-2.0
"""The direction of up: the cluster of surface normals that best agrees with a prior.

Floors, tables and shelves all share one normal, so their normals form the largest cluster near the expected direction,
even where no single plane dominates the frame. Up is minus gravity.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.sensor import CONFIDENCE

_KERNELS = kernels("level_surfaces")
LEAST = CONFIDENCE[0]  # a guess that deserves less is none


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
    limit = np.cos(np.radians(cone_deg))
    up, confidence = _KERNELS.estimate(normals, prior.astype(np.float32), limit)
    return (up, confidence) if confidence >= LEAST else (None, 0.0)


def known_normals(normals: Array, stride: int) -> Array:
    """(N, 3) the normals that are known among every ``stride``-th one of ``normals (3, h, w)``."""
    return np.asarray(_KERNELS.known_normals(normals, stride))
