# SPDX-License-Identifier: Apache-2.0
"""How far odometry may have drifted."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose
from objreg_ros.mapper.drift import Drift
from objreg_ros.mapper.steady import Steady

AHEAD = [pose(np.eye(3), np.array([float(k), 0.0, 0.0])) for k in range(4)]
STEPS = [np.diag([1e-4] * 3 + [1e-6] * 3)] * 3


def test_drift_is_that_of_the_steps_and_of_their_turns_over_the_reach() -> None:
    C = Drift(AHEAD, STEPS, Steady()).between(1, 3)
    assert np.diag(C) == pytest.approx([6e-4 + 6e-6 * 4.0] * 3 + [6e-6] * 3)


def test_what_is_steady_grows_with_the_way() -> None:
    C = Drift(AHEAD, STEPS, Steady(heading=0.1)).between(3, 0)
    assert C[3, 3] == pytest.approx(9e-6 + 0.09)


def test_between_a_keyframe_and_itself_nothing_drifts() -> None:
    assert not Drift(AHEAD, STEPS, Steady(0.1, 0.1, 0.1)).between(2, 2).any()
