# SPDX-License-Identifier: Apache-2.0
"""Errors of trajectories that are known."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error

RNG = np.random.default_rng(3)
T_WORLD_ODOM = pose(rotation_from_vector(np.array([0.3, -2.0, 1.1])), np.array([4.0, -1.0, 2.0]))


def walk(count: int = 40) -> list[np.ndarray]:
    return [pose(np.eye(3), position) for position in np.cumsum(RNG.normal(size=(count, 3)), axis=0)]


def test_a_trajectory_in_another_frame_has_no_error() -> None:
    true = walk()
    assert absolute_trajectory_error([T_WORLD_ODOM @ T for T in true], true) == pytest.approx(0, abs=1e-9)


def test_the_error_is_the_root_of_the_mean_square() -> None:
    true = [pose(np.eye(3), np.array([x, y, 0.0])) for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1))]
    longer = [pose(np.eye(3), T[:3, 3] * [1.2, 1.0, 1.0]) for T in true]
    assert absolute_trajectory_error(longer, true) == pytest.approx(np.sqrt(2 * 0.2**2 / 4))


def test_trajectories_of_different_length_are_refused() -> None:
    with pytest.raises(ValueError, match="as many points"):
        absolute_trajectory_error(walk(3), walk(4))
