# SPDX-License-Identifier: Apache-2.0
"""The total score of an upright pose, of the views and of the objects' silhouettes, and its climb.

Objects that share next to nothing between two views are held by their silhouettes to some degrees only, or drawn
together; the views fix the rest, and from far away: V rises over 20 degrees and 3 cm towards the true pose.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.prepare.views import Sight
from objreg_ros.registration.score.view_score import RANKING_POINTS
from objreg_ros.registration.shapes.shape import Shape
from objreg_ros.registration.shapes.silhouette_score import weights_of
from objreg_ros.sensor import depth_tolerance

_KERNELS = kernels("total_score")
SILHOUETTE_WEIGHT_UPRIGHT = 1.0  # of the silhouette score, beside V, when upright poses are compared
VIOLATION_WEIGHT_UPRIGHT = 5.0  # of violations, beyond their weight in V: an upright pose has no tilt to excuse them
CLIMB_POINTS = 120  # a side, of objects and of views, by which an upright pose is climbed
CLIMB_TURNS_DEG = (3.0, 6.0, 10.0, 15.0, 20.0, 25.0)  # about the objects, either way, with which a climb may begin


class TotalScore:
    """The total score of upright motions (yaw, x, y, rise) of shape ``a`` of source upon ``b`` of target."""

    def __init__(self, source: Prepared, target: Prepared, a: Shape, b: Shape) -> None:
        slops = depth_tolerance(source.sight.noise, target.sight.noise)
        textured = source.sight.textured and target.sight.textured
        weights = np.array([*weights_of(), SILHOUETTE_WEIGHT_UPRIGHT, VIOLATION_WEIGHT_UPRIGHT])
        self._pair = (_image(source.sight), _image(target.sight), slops, textured), a.kernel_arrays, b.kernel_arrays
        self._extent, self._weights = 0.5 * (a.extent + b.extent), weights
        self._sample, self._few = RANKING_POINTS, CLIMB_POINTS
        self._turns = np.radians([0.0, *CLIMB_TURNS_DEG, *(-turn for turn in CLIMB_TURNS_DEG)])

    def of(self, motions: Array) -> Array:
        """The total scores (K,) of motions (K, 4)."""
        return np.asarray(_KERNELS.total_scores(*self._pair, motions, self._extent, self._weights, self._sample))

    def climbed(self, motion: Array) -> Array:
        """The motion (4,) brought to where its total score is highest.

        It is turned first, to where its view score is best: out of what the objects alone are content with.
        """
        climbed = motion.copy()
        _KERNELS.climb(*self._pair, climbed, self._turns, self._extent, self._weights, self._few)
        return climbed


def _image(sight: Sight) -> tuple[Any, ...]:
    return sight.points, sight.shades, (sight.near, sight.far, sight.detail, sight.camera)
