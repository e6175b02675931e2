# SPDX-License-Identifier: Apache-2.0
"""Tests of which of two poses has the better score of views and objects."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.score import comparison
from objreg_ros.registration.score.comparison import LocalScore, score_gain, score_locally
from objreg_ros.registration.score.object_matches import match_objects
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()


@pytest.fixture(autouse=True)
def round_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants of which a test can say what comes of them."""
    monkeypatch.setattr(comparison, "TELLING_GREY", 1000.0)
    monkeypatch.setattr(comparison, "SILHOUETTE_WEIGHT", 0.5)


def scored(score: float, silhouette_score: float, correlation: float | None = 0.9, points: int = 5000) -> LocalScore:
    seen = Verification(
        inliers=0.5, violations=0.0, occluded=0.5, correlation=correlation, tested=2 * points, score=score
    )
    return LocalScore(seen, silhouette_score)


def test_the_true_pose_is_liked_more_than_one_beside_it() -> None:
    here, there = (prepare(keyframe(seen_from(angle), seed=k), PARAMS) for k, angle in enumerate((0.0, 20.0)))
    truth = inverse(seen_from(20.0)) @ seen_from(0.0)
    aside = pose(np.eye(3), np.array([0.02, 0.0, 0.0])) @ truth
    matched, _ = match_objects(here, there, truth)
    right, wrong = (score_locally(here, there, T, matched) for T in (truth, aside))
    assert score_gain(right, wrong) > 0.0 > score_gain(wrong, right)


def test_where_much_grey_correlates_objects_do_not_outvote_it() -> None:
    assert score_gain(scored(1.05, 0.4), scored(1.0, 1.0)) > 0.0


@pytest.mark.parametrize(("correlation", "points"), [(0.9, 200), (0.3, 2000), (0.0, 5000), (-0.2, 5000), (None, 5000)])
def test_where_grey_says_little_objects_have_their_whole_say(correlation: float | None, points: int) -> None:
    alike, unlike = scored(1.0, 1.0, correlation, points), scored(1.05, 0.4, correlation, points)
    assert score_gain(unlike, alike) == pytest.approx(0.05 - 0.5 * 0.6)


def test_the_say_of_objects_falls_with_what_the_grey_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """The more points of grey, and the better it correlates: 1000 (1 - r^2) / (n r) of it is left."""
    alike, unlike = (scored(1.0, silhouette_score, correlation=0.5, points=3000) for silhouette_score in (1.0, 0.0))
    assert score_gain(alike, unlike) == pytest.approx(0.5 * 1000 * 0.75 / 1500)
    monkeypatch.setattr(comparison, "TELLING_GREY", 2000.0)
    assert score_gain(alike, unlike) == pytest.approx(0.5 * 2000 * 0.75 / 1500)


def test_grey_that_is_the_same_leaves_objects_no_say() -> None:
    assert score_gain(scored(1.0, 1.0, correlation=1.0), scored(1.0, 0.0, correlation=1.0)) == 0.0


def test_the_surer_grey_speaks_for_both_and_one_gains_what_the_other_loses() -> None:
    sure, doubtful = scored(1.0, 0.3, correlation=0.8, points=5000), scored(1.0, 0.9, correlation=0.1)
    assert score_gain(doubtful, sure) == pytest.approx(0.5 * 0.6 * 1000 * 0.36 / 4000)
    assert score_gain(sure, doubtful) == pytest.approx(-score_gain(doubtful, sure))


def test_views_that_do_not_meet_leave_all_to_the_objects() -> None:
    unlike, alike = (scored(-3.0, silhouette_score, correlation=None, points=0) for silhouette_score in (0.0, 1.0))
    assert score_gain(alike, unlike) == pytest.approx(0.5)
