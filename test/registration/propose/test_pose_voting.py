# SPDX-License-Identifier: Apache-2.0
"""Tests of the consensus of pairs."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, transform
from objreg_ros.registration.propose.pose_voting import Matches, poses

UP = np.array([0.0, 0.0, 1.0])
YAW = pose(rotation_from_vector(np.array([0.0, 0.0, 2.0])), np.array([0.5, -0.4, 0.1]))
TUMBLE = pose(rotation_from_vector(np.array([1.0, -0.5, 2.0])), np.array([0.5, -0.4, 0.1]))


def matches(T, good: int, bad: int) -> Matches:
    rng = np.random.default_rng(0)
    source, target = rng.uniform(-1, 1, (good + bad, 3)), rng.uniform(-1, 1, (good + bad, 3))
    normals, others = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in rng.normal(size=(2, good + bad, 3)))
    target[:good] = transform(T, source[:good]) + rng.normal(0, 0.01, (good, 3))
    others[:good] = normals[:good] @ T[:3, :3].T
    return Matches(
        source=source, target=target, source_normals=normals, target_normals=others, weights=np.ones(good + bad)
    )


@pytest.mark.parametrize("T", [YAW, inverse(YAW), np.eye(4)])
def test_a_few_true_matches_win_against_many_false_ones_under_gravity(T) -> None:
    best, support = poses(matches(T, 12, 100), UP, UP, 0.06, 0.3, 5)[0]
    rotation, distance = pose_error(best, T)
    assert rotation < 3.0 and distance < 4.0 and support > 6


@pytest.mark.parametrize("T", [TUMBLE, inverse(TUMBLE)])
def test_normals_stand_in_where_gravity_is_unknown(T) -> None:
    best, _ = poses(matches(T, 15, 60), None, None, 0.06, 0.3, 5)[0]
    rotation, distance = pose_error(best, T)
    assert rotation < 6.0 and distance < 6.0


def test_matches_that_agree_on_nothing_give_no_pose() -> None:
    alone = matches(YAW, 1, 0)
    assert poses(alone, UP, UP, 0.06, 0.3, 5) == ()


def standing(source, target, normals) -> Matches:
    unknown = np.zeros((2, 3)) if normals is None else np.array([normals, normals], float)
    return Matches(
        source=np.array(source, float), target=np.array(target, float),
        source_normals=unknown, target_normals=unknown, weights=np.ones(2),
    )  # fmt: skip


def test_a_baseline_that_stands_upright_in_one_frame_gives_no_pose() -> None:
    """It shows no turn about gravity, however little its length differs from that of a slanted one."""
    leaning = standing([[0, 0, 0], [0.25, 0, 0.4]], [[0, 0, 0], [0, 0, 0.45]], None)
    assert poses(leaning, UP, UP, 0.06, 0.3, 5) == ()


def test_a_baseline_along_its_own_normals_gives_no_pose_without_gravity() -> None:
    steps = standing([[0, 0, 1], [0, 0, 1.5]], [[0, 0, 1], [0, 0, 1.5]], [0, 0, -1])
    assert poses(steps, None, None, 0.06, 0.3, 5) == ()


def test_the_same_matches_give_the_same_poses() -> None:
    first, second = (poses(matches(YAW, 10, 50), UP, UP, 0.06, 0.3, 5) for _ in range(2))
    assert all(np.array_equal(a[0], b[0]) and a[1] == b[1] for a, b in zip(first, second, strict=True))
