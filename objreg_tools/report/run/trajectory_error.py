# SPDX-License-Identifier: Apache-2.0
"""How far a trajectory is from the truth.

The absolute trajectory error of Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems" (2012): positions
after the rigid motion that fits the two trajectories best (Horn, 1987).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import rigid_fit, transform


def absolute_errors(estimated: Sequence[Array], true: Sequence[Array]) -> Array:
    """The distance (N,) in metres of each pose (4, 4) from its partner after alignment."""
    positions, targets = (np.array([T[:3, 3] for T in poses]).reshape(-1, 3) for poses in (estimated, true))
    return np.linalg.norm(transform(rigid_fit(positions, targets), positions) - targets, axis=1)


def absolute_trajectory_error(estimated: Sequence[Array], true: Sequence[Array]) -> float:
    """The root of the mean square of `absolute_errors`, m."""
    return root_mean_square(absolute_errors(estimated, true))


def root_mean_square(values: Array) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
