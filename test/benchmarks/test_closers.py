# SPDX-License-Identifier: Apache-2.0
"""Tests of how a method's map is judged."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_ros.geometry import pose
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.truth import Truth


def test_the_error_of_a_trajectory_is_that_of_every_frame_at_rest_or_not() -> None:
    """Odometry rests at the corners of a square, at the last for most of the time, and has their heights wrong."""
    from closers import trajectory_errors

    corners = [(0.0, 0.0, 0.04, 5), (1.0, 0.0, -0.04, 5), (1.0, 1.0, 0.04, 5), (0.0, 1.0, -0.1, 40)]
    true = [pose(np.eye(3), np.array([x, y, 0.0])) for x, y, _, count in corners for _ in range(count)]
    estimated = [pose(np.eye(3), np.array([x, y, z])) for x, y, z, count in corners for _ in range(count)]
    frames = [SimpleNamespace(stamp_ns=k * 10**8, T_odom_camera=T) for k, T in enumerate(estimated)]
    truth = Truth((k * 10**8, T) for k, T in enumerate(true))
    expected = pytest.approx(absolute_trajectory_error(estimated, true), rel=1e-6)
    assert trajectory_errors(frames, [], truth) == (expected, expected, 0)  # type: ignore[arg-type]
