# SPDX-License-Identifier: Apache-2.0
"""When two poses are the same."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registration.kernels.same_pose import AGREEING, Nearness, distinct, near

YAW = pose(rotation_from_vector(np.array([0.0, 0.0, 2.0])), np.array([0.5, -0.4, 0.1]))
TUMBLE = pose(rotation_from_vector(np.array([1.0, -0.5, 2.0])), np.array([0.5, -0.4, 0.1]))
SAME = Nearness(angle=0.1, distance=0.05)


def test_poses_that_are_the_same_come_back_once() -> None:
    beside = YAW @ pose(np.eye(3), np.array([0.01, 0.0, 0.0]))
    assert distinct(np.stack([beside, YAW, np.eye(4)]), np.array([1.0, 2.0, 0.5]), np.zeros(3), 5, SAME) == [1, 2]


@pytest.mark.parametrize(("limit", "count"), [(0, 0), (1, 1), (2, 2), (5, 3)])
def test_no_more_poses_come_back_than_are_wanted(limit: int, count: int) -> None:
    apart = np.stack([TUMBLE, YAW, np.eye(4)])
    assert distinct(apart, np.array([1.0, 3.0, 2.0]), np.zeros(3), limit, SAME) == [1, 2, 0][:count]


@pytest.mark.parametrize(("turn", "shift", "is_near"), [(0.09, 0.19, True), (0.11, 0.0, False), (0.0, 0.21, False)])
def test_what_turns_or_moves_the_middle_too_far_is_not_near(turn: float, shift: float, is_near: bool) -> None:
    middle, nearness = np.array([3.0, 0.0, 0.0]), Nearness(angle=0.1, distance=0.2)
    R = rotation_from_vector(np.array([0.0, 0.0, turn]))
    other = pose(R, middle - R @ middle + [0.0, shift, 0.0])  # it turns about the middle
    assert near(np.array([YAW @ other, YAW]), YAW, middle, nearness).tolist() == [is_near, True]
    assert near(np.zeros((0, 4, 4)), YAW, middle, nearness).shape == (0,)


def test_proposers_agree_within_five_degrees_and_fifteen_centimetres() -> None:
    middle = np.array([0.0, 0.0, 2.0])
    shifted = [pose(np.eye(3), np.array([share * 0.15, 0.0, 0.0])) for share in (0.9, 1.1)]
    about = [rotation_from_vector(np.array([0.0, np.radians(share * 5.0), 0.0])) for share in (0.9, 1.1)]
    turned = [pose(R, middle - R @ middle) for R in about]
    assert near(np.array([*shifted, *turned]), np.eye(4), middle, AGREEING).tolist() == [True, False, True, False]
