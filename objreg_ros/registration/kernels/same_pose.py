# SPDX-License-Identifier: Apache-2.0
"""When two poses are the same, in one place: by the rotation between them and how far they move the middle apart.

Each step has a measure of its own: the nearer to its end, the finer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels

_KERNELS = kernels("same_pose")


class Nearness(NamedTuple):
    """How near two poses are to be the same."""

    angle: float  # rad between them
    distance: float  # m between where they take the middle


PROPOSED = Nearness(np.radians(4.0), 0.04)  # hypotheses, before ICP
BASIN = Nearness(np.radians(5.0), 0.10)  # hypotheses in their basins
SHARED = Nearness(np.radians(4.0), 0.05)  # hypotheses that the whole shape is taken to settle at one place
REFINED = Nearness(np.radians(0.5), 0.01)  # hypotheses after ICP
STARTS = Nearness(np.radians(4.0), 0.06)  # where the search for competing hypotheses begins
AGREEING = Nearness(np.radians(5.0), 0.15)  # what independent proposers came to, and what the gate sees
PROPOSED_FROM = Nearness(np.radians(30.0), 0.5)  # how far ICP may have taken a pose from where it was proposed
VOTES_ANGLE = np.radians(6.0)  # rad between poses that matches vote for
VOTES_TOLERANCES = 1.5  # and the tolerances of a match between where they take the middle


def distinct(T: Array, scores: Array, middle: Array, limit: int, nearness: Nearness) -> list[int]:
    """Indices of the best poses (N, 4, 4), at most ``limit``, no two of which are as near at ``middle (3,)``."""
    order = np.argsort(-scores, kind="stable")
    centres = T[:, :3, :3] @ middle + T[:, :3, 3]
    chosen = _KERNELS.distinct(T, centres, order, limit, np.cos(nearness.angle), nearness.distance)
    return [int(k) for k in chosen]


def near(T: Array, T_known: Array, middle: Array, nearness: Nearness) -> Array:
    """Which of the poses (N, 4, 4) are as near to one at ``middle (3,)``: (N,) bool."""
    cosine = 0.5 * (np.einsum("kij,ij->k", T[:, :3, :3], T_known[:3, :3]) - 1.0)
    moved = np.linalg.norm((T[:, :3, :3] - T_known[:3, :3]) @ middle + T[:, :3, 3] - T_known[:3, 3], axis=-1)
    return np.asarray((cosine > np.cos(nearness.angle)) & (moved < nearness.distance))
