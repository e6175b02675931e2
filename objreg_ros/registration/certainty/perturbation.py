# SPDX-License-Identifier: Apache-2.0
"""The view score of a perturbed pose: by how much it is below that of the pose."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS, count_both_ways, score_counts, score_sharply


class PerturbedScore:
    """A pose and how its view score falls when it is perturbed: ``score`` is V of itself.

    A motion [t r] is of the source camera's pose in the target's axes. A fall is that of the more sensitive grey: in
    the images' own bands, or with one view laid into the other's image.
    """

    def __init__(self, source: Prepared, target: Prepared, T_target_source: Array) -> None:
        self._sights = source.sight, target.sight
        self._T_target_source = T_target_source
        (self._quick,), (ways,) = self._seen(T_target_source[None])
        self.score = self._sharp(T_target_source, ways, self._quick)

    def margin(self, motion: Array) -> float:
        """The score margin of the pose over itself after a motion in either direction, that of the higher score."""
        return self.least_margin(np.array([-motion, motion]))

    def least_margin(self, motions: Array) -> float:
        """The score margin of the pose over itself after that of the motions (K, 6) of the highest score.

        A look at the grey of both in one image takes ten times as long as the other, so where that one finds a larger
        fall than there is elsewhere it is spared.
        """
        poses = perturbed(self._T_target_source, motions)
        quick, ways = self._seen(poses)
        least = np.inf
        for k in np.argsort(-quick):
            if self._quick - quick[k] >= least:
                break
            sharp = self._sharp(poses[k], ways[k], quick[k])
            least = min(least, max(self._quick - quick[k], self.score - sharp))
        return float(least)

    def _seen(self, T_target_source: Array) -> tuple[Array, list[tuple[Array, Array]]]:
        """V (K,) of poses (K, 4, 4) with the grey of each image's own band, and what was counted at each."""
        sample = PHOTOMETRIC_POINTS
        ways = count_both_ways(*self._sights, T_target_source, sample)
        return score_counts(*self._sights, *ways, sample), list(zip(*ways, strict=True))

    def _sharp(self, T_target_source: Array, ways: tuple[Array, Array], quick: float) -> float:
        """V of a pose (4, 4) with the grey of both in one image; the ``quick`` one of views without grey."""
        if not all(sight.textured for sight in self._sights):
            return float(quick)
        return score_sharply(*self._sights, T_target_source, ways, PHOTOMETRIC_POINTS)


def perturbed(T_target_source: Array, motions: Array) -> Array:
    """The poses (..., 4, 4) that a pose (4, 4) becomes by motions [t r] (..., 6)."""
    R, t = T_target_source[:3, :3], T_target_source[:3, 3]
    return pose(rotation_from_vector(motions[..., 3:]) @ R, t + motions[..., :3])


def turned_about(T_target_source: Array, middle: Array, up: Array, turns: Array) -> Array:
    """The poses (K, 4, 4) that a pose (4, 4) becomes by ``turns (K,)`` rad about ``up (3,)`` through ``middle (3,)``.

    Both in the target's axes.
    """
    R = rotation_from_vector(np.asarray(turns)[:, None] * up)
    return np.asarray(pose(R, middle - R @ middle) @ T_target_source)


def square_grid(step: float, steps: int) -> Array:
    """The places (K, 2) m of a square of so many ``steps`` each way, row by row, its middle in the middle."""
    ticks = step * np.arange(-steps, steps + 1)
    return np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
