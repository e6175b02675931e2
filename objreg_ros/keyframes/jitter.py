# SPDX-License-Identifier: Apache-2.0
"""How far odometry errs at each pose for itself, measured from poses that are sure.

Drift grows with the path, jitter does not: a visual-inertial tracker that corrects itself leaps by degrees from one
keyframe to the next and back. Two sure poses of neighbouring keyframes that odometry carries to each other then differ
by more than both are unsure of. Wrong poses among them differ by more still, so the lower quartile decides: as long as
half of the poses are right, at least half of the pairs are of two that are right, or of two that err alike.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array

LEAST_PAIRS = 24  # fewer measure nothing
MOST_PAIRS = 1024  # that are kept, the newest
QUANTILE, QUANTILE_OF_CHI2 = 0.25, 0.404  # and what it is of the square of three normal numbers, as a share of the mean
ENDS = 4  # poses of odometry between two pairs of keyframes that share none
DEVIATIONS = 2.0  # of a difference by jitter alone: fewer than 1 in 100 are larger
MOST_ROTATION_DEG, MOST_TRANSLATION_M = 8.0, 0.15  # by which jitter excuses a difference: what has moved goes farther


class Jitter(NamedTuple):
    """The root mean square by which a pose of odometry errs for itself."""

    rotation_deg: float
    translation_m: float

    def allowance(self) -> Jitter:
        """By how much two pairs of keyframes may differ for it."""
        scale = DEVIATIONS * ENDS**0.5
        rotation_deg = min(scale * self.rotation_deg, MOST_ROTATION_DEG)
        return Jitter(rotation_deg, min(scale * self.translation_m, MOST_TRANSLATION_M))


STEADY = Jitter(0.0, 0.0)


class JitterMeter:
    """Measures the jitter of one odometry from differences between sure poses, as they come."""

    def __init__(self) -> None:
        self._pairs: deque[tuple[float, ...]] = deque(maxlen=MOST_PAIRS)
        self.jitter = STEADY

    def add_differences(self, differences: Array, explained: Array, ends: Array) -> None:
        """Take in differences (N, 2) of sure poses, degrees and m, of whose squares so much is ``explained (N, 2)``.

        ``ends (N,)`` are the poses of odometry between each two; those between which there is none measure nothing.
        What rotations add to a translation counts as the translation's.
        """
        between = ends > 0
        squares = np.hstack((np.square(differences), explained))[between] / ends[between, None]
        self._pairs.extend(map(tuple, squares.tolist()))
        if len(self._pairs) >= LEAST_PAIRS:
            self.jitter = _measured(np.array(self._pairs))


def _measured(pairs: Array) -> Jitter:
    """The jitter by squares (N, 4) for one pose of odometry: of differences and of what explains them."""
    found = np.quantile(pairs[:, :2], QUANTILE, axis=0) / QUANTILE_OF_CHI2 - np.median(pairs[:, 2:], axis=0)
    return Jitter(*map(float, np.sqrt(np.maximum(found, 0.0))))
