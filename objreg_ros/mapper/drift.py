# SPDX-License-Identifier: Apache-2.0
"""How far odometry may have drifted between two keyframes: what a closure there may disagree with it by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_ros.data import Array
from objreg_ros.mapper.steady import Steady


class Drift:
    """``T_odom_body`` of the keyframes and the covariance (6, 6) of each step between them, and what is ``steady``."""

    def __init__(self, poses: Sequence[Array], steps: Sequence[Array], steady: Steady) -> None:
        self._places = np.array([T[:3, 3] for T in poses])
        lengths = np.linalg.norm(np.diff(self._places, axis=0), axis=1)
        self._way = np.concatenate([[0.0], np.cumsum(lengths)])
        self._variances = np.concatenate([np.zeros((1, 6)), np.cumsum([np.diag(C) for C in steps], axis=0)])
        self._steady = steady

    def between(self, k1: int, k2: int) -> Array:
        """The covariance (6, 6) of the motion from the one keyframe to the other, alike in all axes.

        A turn anywhere on the way shifts its end by no more than the farthest place on it is away from there.
        """
        k1, k2 = min(k1, k2), max(k1, k2)
        wandered, way = self._variances[k2] - self._variances[k1], self._way[k2] - self._way[k1]
        reach = float(np.linalg.norm(self._places[k1 : k2 + 1] - self._places[k2], axis=1).max())
        turned = wandered[3:].sum() + (self._steady.heading * way) ** 2
        stretched = max(self._steady.along, self._steady.across) * reach
        return np.diag(np.repeat([wandered[:3].sum() + turned * reach**2 + stretched**2, turned], 3))
