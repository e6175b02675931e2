# SPDX-License-Identifier: Apache-2.0
"""What the views think of a pose that is pushed: by how much they like it less."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared
from objreg_ros.registrar.verify import rank, rank_sharply


class Stand:
    """Where a pose stands: ``score`` is V of itself, and it falls when the pose is pushed.

    A motion [t r] is of the source camera's pose in the target's axes. A fall is that of whichever grey tells more: in
    the images' own bands, or with one view laid into the other's image.
    """

    def __init__(self, source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> None:
        self._sights = source.sight, target.sight
        self._params = params
        self._T_target_source = T_target_source
        self._own = self._liked(T_target_source[None])
        self.score = float(self._own[1, 0])

    def falls(self, motions: Iterable[Array]) -> Array:
        """How much less the views like the pose after each motion (K,)."""
        poses = np.array([pushed(self._T_target_source, motion) for motion in motions])
        return np.asarray((self._own - self._liked(poses)).max(axis=0))

    def fall(self, motion: Array) -> float:
        """How much less they like it after a motion either way, the way that they like more."""
        return float(self.falls((-motion, motion)).min())

    def _liked(self, T_target_source: Array) -> Array:
        """V (2, K) of poses (K, 4, 4), by either grey."""
        ways = rank, rank_sharply
        return np.array([way(*self._sights, T_target_source, self._params, self._params.grey_points) for way in ways])


def pushed(T_target_source: Array, motion: Array) -> Array:
    """The pose (4, 4) after a motion [t r]."""
    R, t = T_target_source[:3, :3], T_target_source[:3, 3]
    return pose(rotation_from_vector(motion[3:]) @ R, t + motion[:3])
