# SPDX-License-Identifier: Apache-2.0
"""Poses from matched keypoints, with gravity and without."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, is_rigid, pose_error
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import Pair, prepare
from objreg_ros.registration.propose.keypoint_poses import LEAST_MATCHES, from_keypoints
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
HERE, THERE = seen_from(0.0), seen_from(15.0, height=1.7)
TRUTH = inverse(THERE) @ HERE


def pair(gravity: bool = True, grey: bool = True) -> Pair:
    """The room from two sides."""
    source, target = (
        prepare(keyframe(T, seed=seed, gravity=gravity, grey=grey), PARAMS) for seed, T in ((1, HERE), (2, THERE))
    )
    return Pair(source=source, target=target)


@pytest.mark.parametrize("gravity", [True, False])
def test_the_first_pose_is_the_true_one_with_gravity_and_without(gravity: bool) -> None:
    found = from_keypoints(pair(gravity))
    degrees, cm = pose_error(found[0].T_target_source, TRUTH)
    assert degrees < 3.0 and cm < 8.0
    assert found[0].proposer == "keypoints" and found[0].support >= LEAST_MATCHES
    assert all(is_rigid(one.T_target_source) for one in found)


def test_the_poses_come_by_their_support() -> None:
    support = [one.support for one in from_keypoints(pair())]
    assert support == sorted(support, reverse=True)


@pytest.mark.parametrize("gravity", [True, False])
def test_the_same_views_give_the_same_poses_to_the_last_digit(gravity: bool) -> None:
    one, other = (np.array([h.T_target_source for h in from_keypoints(pair(gravity))]) for _ in range(2))
    assert np.array_equal(one, other)


def test_the_other_direction_gives_the_inverse_pose() -> None:
    both = pair()
    found = from_keypoints(Pair(source=both.target, target=both.source))
    degrees, cm = pose_error(found[0].T_target_source, inverse(TRUTH))
    assert degrees < 3.0 and cm < 8.0


def test_views_without_grey_give_no_pose() -> None:
    assert from_keypoints(pair(grey=False)) == []
