# SPDX-License-Identifier: Apache-2.0
"""How many matched keypoints a pose brings together, and how many its best rival."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.registration.prepare.keypoints import KeypointMatches, Keypoints
from objreg_ros.registration.score.keypoint_agreement import LEAST_KEYPOINTS, agreeing, agreements

FOCAL_PX = 131.25
T_TRUE = pose(rotation_from_vector(np.array([0.0, np.radians(10.0), 0.0])), np.array([0.3, 0.0, 0.1]))
NONE = np.zeros((0, 4, 4))


def seen(xyz: np.ndarray, measured: bool = True) -> Keypoints:
    """Keypoints at points of a camera."""
    rays, nothing = xyz[:, :2] / xyz[:, 2:], np.zeros_like(xyz)
    return Keypoints(rays, xyz if measured else nothing, nothing, np.zeros((len(xyz), 128), np.float32), FOCAL_PX)


def matched(
    xyz: np.ndarray, T_target_source: np.ndarray = T_TRUE, measured: tuple[bool, bool] = (True, True)
) -> SimpleNamespace:
    """A pair whose keypoints are matched as a pose says."""
    source, target = seen(xyz, measured[0]), seen(transform(T_target_source, xyz), measured[1])
    every = np.arange(len(xyz))
    middle = xyz.mean(axis=0)
    return SimpleNamespace(
        keypoint_matches=KeypointMatches(source, target, every, every), source=SimpleNamespace(middle=middle)
    )


def spread(count: int = 40, seed: int = 0) -> np.ndarray:
    """Points all over a picture, 2 to 3 m away."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(2.0, 3.0, count)
    return np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)) * z[:, None], z])


@pytest.mark.parametrize("measured", [(True, True), (True, False), (False, True)])
def test_all_matches_agree_with_the_true_pose_if_either_end_has_depth(measured: tuple[bool, bool]) -> None:
    (found,) = agreements(matched(spread(), measured=measured), T_TRUE[None], NONE)
    assert found is not None and found.matches == 40 and 15 < found.cells <= 40 and found.rival_matches == 0


def test_single_matches_agree_with_a_pose_or_not() -> None:
    matches = matched(spread()).keypoint_matches
    source, target, a, b = matches
    crossed = KeypointMatches(source, target, a, np.concatenate([b[:30], b[30:][::-1]]))
    assert agreeing(matches, T_TRUE).all() and not agreeing(matches, np.eye(4)).any()
    assert agreeing(crossed, T_TRUE)[:30].all() and not agreeing(crossed, T_TRUE)[30:].any()


def test_matches_without_any_depth_agree_with_nothing() -> None:
    (found,) = agreements(matched(spread(), measured=(False, False)), T_TRUE[None], NONE)
    assert found is not None and found.matches == 0 and found.cells == 0


def test_a_pose_10_cm_off_brings_next_to_none_together_and_has_the_true_one_as_rival() -> None:
    off = T_TRUE.copy()
    off[0, 3] += 0.1
    far = T_TRUE.copy()
    far[0, 3] += 0.5
    near_by, beside = agreements(matched(spread()), np.array([off, far]), T_TRUE[None])
    assert near_by is not None and near_by.matches < 4 and near_by.rival_matches == 0  # the true one is no other place
    assert beside is not None and beside.matches < 4 and beside.rival_matches == 40 and beside.rival_cells > 15


def test_the_print_of_one_thing_counts_for_the_cells_that_it_covers() -> None:
    thing = np.column_stack([np.random.default_rng(1).uniform(-0.05, 0.05, (40, 2)), np.full(40, 2.0)])
    (found,) = agreements(matched(thing), T_TRUE[None], NONE)
    assert found is not None and found.matches == 40 and found.cells <= 4


def test_points_behind_the_other_camera_agree_with_nothing() -> None:
    behind = pose(np.eye(3), np.array([0.0, 0.0, -5.0]))
    (found,) = agreements(matched(spread()), behind[None], NONE)
    assert found is not None and found.matches == 0


def test_the_count_is_the_same_from_either_end() -> None:
    pair = matched(spread(), measured=(True, True))
    turned = SimpleNamespace(keypoint_matches=pair.keypoint_matches.turned(), source=pair.source)
    off = T_TRUE @ pose(np.eye(3), np.array([0.02, 0.0, 0.0]))
    (there,) = agreements(pair, off[None], NONE)
    (back,) = agreements(turned, inverse(off)[None], NONE)
    assert there is not None and back is not None and there[:2] == back[:2]


def test_nothing_is_known_of_a_view_with_hardly_any_keypoints() -> None:
    few = matched(spread(LEAST_KEYPOINTS - 1))
    assert agreements(few, np.array([T_TRUE, np.eye(4)]), NONE) == [None, None]
