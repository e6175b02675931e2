# SPDX-License-Identifier: Apache-2.0
"""Tests of what an upright pose of objects is worth."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error
from objreg_ros.native import kernels
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.score import total_score
from objreg_ros.registration.score.total_score import TotalScore
from objreg_ros.registration.score.view_score import score_views
from objreg_ros.registration.shapes.shape import upright_motion, upright_pose
from objreg_ros.registration.shapes.silhouette_score import score_silhouettes
from registration.drawn_shapes import BOX, from_side, keyframe

PARAMS = RegistrarParams()
TRUTH = inverse(from_side(0.0)) @ from_side(30.0)


@pytest.fixture(scope="module")
def pair():
    things = {"box": BOX, "can": (0.02, 0.15)}
    return tuple(prepare(keyframe(from_side(a), things, seed=1), PARAMS) for a in (30.0, 0.0))


def test_the_kernel_and_the_shapes_mean_the_same_pose(pair) -> None:
    a, b = (each.scene for each in pair)
    motion = np.array([0.4, 0.03, -0.02, 0.01])
    T, back = kernels("total_score").poses(a.kernel_arrays, b.kernel_arrays, motion)
    assert np.allclose(T, upright_pose(a, b, motion)) and np.allclose(T @ back, np.eye(4))


def test_worth_is_what_the_views_like_and_how_alike_the_objects_look(pair, monkeypatch: pytest.MonkeyPatch) -> None:
    source, target = pair
    a, b = source.scene, target.scene
    motion = upright_motion(a, b, TRUTH)
    monkeypatch.setattr(total_score, "VIOLATION_WEIGHT_UPRIGHT", 0.0)
    monkeypatch.setattr(total_score, "RANKING_POINTS", 10**6)
    V = score_views(source.sight, target.sight, upright_pose(a, b, motion)[None], 10**6)[0]
    same = np.clip(score_silhouettes(a, b, motion), -1.0, 1.0)
    assert TotalScore(source, target, a, b).of(motion[None])[0] == pytest.approx(V + same)


def test_seen_free_space_costs_more_than_in_the_views_verdict(pair, monkeypatch: pytest.MonkeyPatch) -> None:
    source, target = pair
    off = upright_motion(source.scene, target.scene, TRUTH) + np.array([0.0, 0.1, 0.0, 0.0])
    scores = []
    for weight in (5.0, 0.0):
        monkeypatch.setattr(total_score, "VIOLATION_WEIGHT_UPRIGHT", weight)
        scores.append(TotalScore(source, target, source.scene, target.scene).of(off[None])[0])
    assert scores[0] < scores[1]


@pytest.mark.parametrize("off", [(0.25, 0.02, 0.0, 0.0), (-0.4, 0.0, 0.02, 0.0), (0.1, 0.02, -0.01, 0.0)])
def test_a_climb_comes_back_from_far_away(pair, off: tuple) -> None:
    source, target = pair
    a, b = source.scene, target.scene
    start = upright_motion(a, b, TRUTH) + np.array(off)
    degrees, _ = pose_error(upright_pose(a, b, TotalScore(source, target, a, b).climbed(start)), TRUTH)
    assert degrees < 2.0


def test_a_climb_leaves_its_start_as_it_was(pair) -> None:
    source, target = pair
    start = upright_motion(source.scene, target.scene, TRUTH) + np.array([0.2, 0.0, 0.0, 0.0])
    kept = start.copy()
    TotalScore(source, target, source.scene, target.scene).climbed(start)
    assert np.array_equal(start, kept)
