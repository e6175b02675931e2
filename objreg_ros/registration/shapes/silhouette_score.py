# SPDX-License-Identifier: Apache-2.0
"""How well two shapes agree under an upright motion: the two-way visibility score on their silhouettes.

A point on the other's surface counts for a motion. One that floats in seen free space, beside the silhouette or before
it, counts a dozen times as much against it. One that is hidden counts little. The grey separates the sides of an
object: where both are textured it should correlate, and if it does not, that counts against the motion too.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.shapes.shape import Shape

_KERNELS = kernels("silhouette_score")
ask, climb, tally = _KERNELS.ask, _KERNELS.climb, _KERNELS.tally
VIOLATION_WEIGHT = 12.0  # of an object's points in seen free space
OCCLUSION_WEIGHT = 0.6  # of an object's points behind what was seen
RESIDUAL_WEIGHT = 1.2  # of squared distances from what was seen
GREY_WEIGHT = 3.0  # of the correlation of grey
GREY_NEUTRAL = 0.3  # correlation of grey that says nothing
GREY_NOISE = 12.0  # standard deviation of grey that is noise, in grey levels

# What `tally` counts.
INLIERS, VIOLATIONS, HIDDEN, RESIDUAL, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB = range(10)
COUNTS = 10
STEPS = 8  # rounds of a climb to what is nearby, each a step of that share of its reach at most


def weights_of() -> Array:
    """(6,): of free-space violations, hidden points, squared residuals and grey; expected correlation, grey's noise."""
    return np.array(
        [
            VIOLATION_WEIGHT,
            OCCLUSION_WEIGHT,
            RESIDUAL_WEIGHT,
            GREY_WEIGHT,
            GREY_NEUTRAL,
            GREY_NOISE**2,
        ]
    )


def score_silhouettes(source: Shape, target: Shape, motion: Array, reach: float = 0.0) -> float:
    """The score of a motion (yaw, x, y, rise): near 1 and more if right, below 0 if the cameras saw otherwise.

    The best that a climb finds within ``reach`` m along each axis, height too, turned as much.
    """
    extent, most = 0.5 * (source.extent + target.extent), source.most + target.most
    steps = np.array([0.0, reach, reach, reach]) / STEPS
    return float(
        climb(source.kernel_arrays, target.kernel_arrays, motion.copy(), extent, weights_of(), most, steps, STEPS)
    )
