# SPDX-License-Identifier: Apache-2.0
"""A pose in a message's own numbers."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.formats.pose import fill_pose

from .blank import QUARTER_LEFT, blank, numbers


def test_a_pose_is_a_position_and_a_quaternion_with_w_last() -> None:
    message = blank()
    fill_pose(message.position, message.orientation, QUARTER_LEFT)
    assert numbers(message) == pytest.approx([1, 2, 3, 0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    assert all(type(value) is float for value in numbers(message))
