# SPDX-License-Identifier: Apache-2.0
"""Where a landmark is by all of its sightings, and how sure that is."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.landmarks import MIDDLE_WANDERS, RADIUS_M

SIGMAS = 3.0  # deviations that the reach of a landmark stands for
PRIOR = 3.0  # sightings that the deviation assumed beforehand counts as much as


def position_of(xyz: Array, extents: Array) -> tuple[Array, Array]:
    """The position (3,) m and its covariance (3, 3) m^2 by the middles ``xyz (N, 3)`` of N >= 1 sightings.

    All in one frame, the oldest first; ``extents (N,)`` m. An object that was moved is where it was seen last: what
    lies farther from that than two sightings of one object may is left out. The covariance says how far off one
    sighting may be, not the mean of them: the side that is seen and the drift of the map err alike in many. It is the
    scatter, with a prior of a third of the reach, as of an inverse Wishart distribution. ValueError without a
    sighting.
    """
    if len(xyz) == 0 or xyz.shape != (len(extents), 3):
        raise ValueError(f"expected an extent for each of at least 1 position, got {xyz.shape} and {extents.shape}")
    reach = RADIUS_M + MIDDLE_WANDERS * float(np.median(extents))
    near = xyz[np.linalg.norm(xyz - xyz[-1], axis=1) <= 2.0 * reach]
    middle = near.mean(axis=0)
    off = near - middle
    prior = PRIOR * (reach / SIGMAS) ** 2 * np.eye(3)
    return middle, (prior + off.T @ off) / (PRIOR + len(near) - 1)
