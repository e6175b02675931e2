# SPDX-License-Identifier: Apache-2.0
"""Tests of the whole-view check."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.registration.prepare.views import Sight, prepare_sight
from objreg_ros.registration.score import view_score as verify_module
from objreg_ros.registration.score.free_space import INLIERS, OCCLUDED, SEEN, VIOLATIONS
from objreg_ros.registration.score.view_score import (
    NO_TEXTURE,
    WORST,
    certain_violations,
    count_both_ways,
    count_visibility,
    rated,
    rated_quickly,
    score_views,
    verify,
)
from objreg_ros.sensor import DEPTH_TOLERANCE_GROWTH, DEPTH_TOLERANCE_M
from registration.rooms import CAMERA, keyframe, seen_from


@pytest.fixture(scope="module")
def sights():
    return tuple(prepare_sight(keyframe(seen_from(a), seed=k).view, 4.0, 3.0) for k, a in enumerate((0.0, 25.0)))


TRUTH = inverse(seen_from(25.0)) @ seen_from(0.0)


def test_the_true_pose_is_believed(sights) -> None:
    found = verify(*sights, TRUTH)
    assert found.score > 0.5
    assert found.violations < 0.05
    assert found.correlation is not None and found.correlation > 0.5


def test_both_ways_round_give_the_same_answer(sights) -> None:
    forward, backward = verify(*sights, TRUTH), verify(sights[1], sights[0], inverse(TRUTH))
    assert forward.score == pytest.approx(backward.score, abs=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_a_pose_off_by_twenty_centimetres_is_worth_less(sights, axis: int) -> None:
    shift = pose(np.eye(3), 0.2 * np.eye(3)[axis])
    assert verify(*sights, shift @ TRUTH).score < verify(*sights, TRUTH).score - 0.2


def test_views_that_do_not_meet_are_not_tested(sights) -> None:
    away = pose(rotation_from_vector(np.array([0.0, np.pi, 0.0])), np.zeros(3))
    found = verify(*sights, away)
    assert found.tested == 0 and found.score == -3.0 and found.correlation is None


def test_a_ragged_edge_does_not_float_and_a_thing_that_is_gone_does(sights) -> None:
    assert certain_violations(*sights, TRUTH) < 0.01
    a_little_off = pose(np.eye(3), np.array([0.03, 0.0, 0.0])) @ TRUTH
    assert certain_violations(*sights, a_little_off) < verify(*sights, a_little_off).violations
    far_off = pose(np.eye(3), np.array([0.0, 0.0, -0.4])) @ TRUTH
    assert certain_violations(*sights, far_off) > 0.1


def seen_at(depth: float | Array) -> Sight:
    """What is seen of a surface at this depth, one of each column of the image or of all."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    xyz = (rays * np.broadcast_to(depth, u.shape)[..., None]).astype(np.float32)
    return prepare_sight(View(xyz=xyz, grey=None, intrinsics=CAMERA), 4.0, 3.0)


@pytest.mark.parametrize(("tolerances", "share"), [(1.8, 0.0), (2.2, 1.0)])
def test_what_is_nearer_by_more_than_twice_the_tolerance_floats(tolerances: float, share: float) -> None:
    tolerance = DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH * 2.0**2
    nearer = seen_at(2.0), seen_at(2.0 + tolerances * tolerance)
    assert certain_violations(*nearer, np.eye(4)) == certain_violations(*nearer[::-1], np.eye(4)) == share


def test_nothing_floats_a_few_pixels_beside_what_is_as_near() -> None:
    column = np.arange(CAMERA.width)
    post, beside = (seen_at(np.where((column >= at) & (column < at + 3), 1.0, 2.0)) for at in (80, 84))
    assert verify(post, beside, np.eye(4)).violations > 0.01
    assert certain_violations(post, beside, np.eye(4)) == 0.0


def test_views_that_do_not_meet_float_altogether(sights) -> None:
    assert certain_violations(*sights, pose(np.eye(3), np.array([0.0, 0.0, 90.0]))) == 1.0


def test_many_poses_are_looked_at_both_ways_like_each_alone(sights) -> None:
    source, target = sights
    poses = np.stack([TRUTH, pose(rotation_from_vector(np.array([0.0, 0.1, 0.0])), np.array([0.1, 0.0, 0.05])) @ TRUTH])
    forward, backward = count_both_ways(source, target, poses, 3000)
    for k, T in enumerate(poses):
        np.testing.assert_allclose(forward[k], count_visibility(source, target, T, 3000), rtol=1e-6)
        np.testing.assert_allclose(backward[k], count_visibility(target, source, inverse(T), 3000), rtol=1e-6)
    alone = [verify(source, target, T, 3000).score for T in poses]
    assert score_views(source, target, poses, 3000) == pytest.approx(alone) and alone[0] > alone[1]


def counted(seen: int, inliers: int, violations: int = 0, occluded: int = 0) -> np.ndarray:
    """What one way of looking counts."""
    counts = np.zeros(10)
    counts[[SEEN, INLIERS, VIOLATIONS, OCCLUDED]] = seen, inliers, violations, occluded
    return counts


def test_v_is_of_the_worse_way_the_grey_and_the_share_that_could_be_tested() -> None:
    forward, backward = counted(100, 90, 10), counted(300, 150, 3)
    for ways in ((forward, backward), (backward, forward)):
        assert rated(*ways, 0.4, 400) == pytest.approx(0.4 + 0.5 - 3.0 * 0.1 - 0.65)
        assert rated(*ways, 0.4, 4000) == pytest.approx(0.4 + 0.5 - 3.0 * 0.1 - 0.5 - 0.65)
        assert rated_quickly(*ways, False, 400) == pytest.approx(rated(*ways, NO_TEXTURE, 400))
    for ways in ((forward, counted(0, 0)), (counted(0, 0), forward)):
        assert rated(*ways, 1.0, 400) == WORST


def test_what_is_said_of_a_pose_is_what_the_worse_way_says_of_each(monkeypatch: pytest.MonkeyPatch) -> None:
    ways = {1: counted(100, 90, 10, 5), 2: counted(300, 150, 3, 60)}
    monkeypatch.setattr(verify_module, "count_visibility", lambda source, *_: ways[source.side])
    one, other = (SimpleNamespace(side=side, textured=False, points=range(200)) for side in (1, 2))
    for sights in ((one, other), (other, one)):
        found = verify(*sights, TRUTH)
        assert (found.inliers, found.violations, found.occluded, found.correlation) == (0.5, 0.1, 0.2, None)
        assert found.tested == 400 and found.score == pytest.approx(NO_TEXTURE + 0.5 - 3.0 * 0.1 - 0.65)


def test_views_of_which_only_one_sees_the_other_do_not_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    ways = {1: counted(100, 90), 2: counted(0, 0)}
    monkeypatch.setattr(verify_module, "count_visibility", lambda source, *_: ways[source.side])
    one, other = (SimpleNamespace(side=side, textured=False, points=range(200)) for side in (1, 2))
    for sights in ((one, other), (other, one)):
        assert (verify(*sights, TRUTH).tested, verify(*sights, TRUTH).score) == (0, WORST)
