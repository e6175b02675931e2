# SPDX-License-Identifier: Apache-2.0
"""Tests of the end of a registration."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose.refinement import refine
from objreg_ros.registration.refine.batch_icp import settle
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
OFF = pose(rotation_from_vector(np.array([0.005, 0.01, -0.005])), np.array([0.02, -0.02, 0.02]))
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)


@pytest.fixture(scope="module")
def pair():
    return tuple(prepare(keyframe(seen_from(a), seed=k), PARAMS) for k, a in enumerate((0.0, 20.0)))


def test_a_shifted_start_comes_back_to_the_truth(pair) -> None:
    found = refine(*pair, settle(*pair, (OFF @ TRUTH)[None])[0][0])
    rotation, distance = pose_error(found.T_target_source, TRUTH)
    assert rotation < 0.5 and distance < 1.5 and found.converged


def test_the_inverted_problem_has_the_inverted_answer(pair) -> None:
    settled, _ = settle(pair[1], pair[0], inverse(OFF @ TRUTH)[None])
    found = refine(pair[1], pair[0], settled[0])
    rotation, distance = pose_error(found.T_target_source, inverse(TRUTH))
    assert rotation < 0.5 and distance < 1.5


def test_the_pattern_of_a_bare_wall_holds_what_its_shape_lets_slide() -> None:
    T = seen_from(0.0, height=0.75)
    wall = prepare(keyframe(T, WALL, noise=0.0003), PARAMS)
    shifted = prepare(keyframe(T @ pose(np.eye(3), np.array([0.04, 0.0, 0.0])), WALL, noise=0.0003, seed=1), PARAMS)
    found = refine(shifted, wall, np.eye(4))
    assert len(found.degenerate) == 0
    assert pose_error(found.T_target_source, pose(np.eye(3), np.array([0.04, 0.0, 0.0])))[1] < 1.0


def test_a_pattern_that_does_not_correlate_holds_nothing() -> None:
    here, there = pose(np.eye(3), np.zeros(3)), pose(np.eye(3), np.array([0.5, 0.3, 0.0]))
    views = [prepare(keyframe(seen_from(0.0, height=0.75) @ T, WALL, noise=0.0003), PARAMS) for T in (here, there)]
    assert len(refine(*views, settle(*views, np.eye(4)[None])[0][0]).degenerate) == 3


def test_what_settles_on_nothing_is_distinguished_from_what_the_shape_holds(pair) -> None:
    far = pose(np.eye(3), np.array([50.0, 0.0, 0.0]))
    _, held = settle(*pair, np.array([OFF @ TRUTH, far]))
    assert held.tolist() == [True, False]


def test_a_start_far_away_does_not_converge(pair) -> None:
    found = refine(*pair, pose(np.eye(3), np.array([50.0, 0.0, 0.0])))
    assert found.inliers == 0 and not found.converged


@pytest.fixture
def rightwards(monkeypatch):
    """Grey that moves a pose by 3 cm, which the views like a little more; as many points of it correlate as is said."""

    def shifted(source, target, T):
        return pose(np.eye(3), np.array([0.03, 0.0, 0.0])) @ T, np.zeros((6, 6))

    def seen_by(points: int) -> None:
        def verify(source, target, T, sample=None):
            score = 0.5 + T[0, 3] - TRUTH[0, 3]
            return Verification(inliers=1.0, violations=0.0, occluded=0.0, correlation=0.8, tested=points, score=score)

        monkeypatch.setattr("objreg_ros.registration.propose.refinement.finish", shifted)
        monkeypatch.setattr("objreg_ros.registration.score.comparison.verify", verify)

    return seen_by


def test_objects_that_look_alike_are_not_taken_apart_by_little_grey(pair, rightwards, monkeypatch) -> None:
    rightwards(points=300)
    assert np.allclose(refine(*pair, TRUTH).T_target_source, TRUTH)
    monkeypatch.setattr("objreg_ros.registration.score.comparison.SILHOUETTE_WEIGHT", 0.0)
    assert pose_error(refine(*pair, TRUTH).T_target_source, TRUTH)[1] > 2.0


def test_much_grey_moves_a_pose_though_objects_look_less_alike_there(pair, rightwards) -> None:
    rightwards(points=300_000)
    assert pose_error(refine(*pair, TRUTH).T_target_source, TRUTH)[1] > 2.0
