# SPDX-License-Identifier: Apache-2.0
"""Poses over time."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.trajectory import Trajectory
from objreg_ros.geometry import pose, rotation_angle, rotation_from_vector


def along_x() -> Trajectory:
    trajectory = Trajectory()
    trajectory.append(100, np.eye(4))
    trajectory.append(200, pose(rotation_from_vector(np.array([0.0, 0.0, 1.0])), np.array([1.0, 0.0, 0.0])))
    return trajectory


def test_a_pose_between_two_is_interpolated() -> None:
    T = along_x().at(125)
    np.testing.assert_allclose(T[:3, 3], [0.25, 0.0, 0.0])
    assert rotation_angle(T[:3, :3]) == pytest.approx(0.25)


def test_the_ends_are_covered_and_nothing_beyond() -> None:
    trajectory = along_x()
    assert [trajectory.covers(stamp) for stamp in (99, 100, 200, 201)] == [False, True, True, False]
    np.testing.assert_allclose(trajectory.at(200)[:3, 3], [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="expected a stamp within 100 to 200 ns, got 99 ns"):
        trajectory.at(99)


def test_the_nearest_pose_in_time_is_found() -> None:
    assert [along_x().nearest(stamp) for stamp in (0, 149, 151, 900)] == [0, 0, 1, 1]


def test_time_has_to_advance() -> None:
    trajectory = along_x()
    with pytest.raises(ValueError, match="expected a stamp after 200 ns, got 200 ns"):
        trajectory.append(200, np.eye(4))
    with pytest.raises(ValueError, match="at least one pose"):
        Trajectory().nearest(0)
