# SPDX-License-Identifier: Apache-2.0
"""Tests of the closer look at poses of one object upon another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose import fine_search as fine_search_module
from objreg_ros.registration.propose.fine_search import ALONG, SEARCHED, FineSearch, score_views_sharply
from objreg_ros.registration.score.view_score import RANKING_POINTS, WORST, count_both_ways, verify
from objreg_ros.registration.shapes.shape import upright_motion, upright_pose
from objreg_ros.registration.shapes.silhouette_score import score_silhouettes
from registration.drawn_shapes import ELL, error, from_side, keyframe
from registration.rooms import shade

PARAMS = RegistrarParams()
ANGLE = 110.0


def printed(T_world_camera: Array) -> Keyframe:
    """The thing on a table with a print."""
    key = keyframe(T_world_camera, {"ell": ELL}, seed=1)
    return replace(key, view=replace(key.view, grey=shade(transform(T_world_camera, np.nan_to_num(key.view.xyz)))))


@pytest.fixture(scope="module")
def looked():
    """A closer look at two sides of a thing that share nothing, and the motion between them."""
    source, target = (prepare(printed(from_side(a)), PARAMS) for a in (ANGLE, 0.0))
    a, b = source.shapes[0], target.shapes[0]
    assert a is not None and b is not None
    truth = upright_motion(a, b, inverse(from_side(0.0)) @ from_side(ANGLE))
    return FineSearch(source, target, a, b), truth, lambda motion: error(upright_pose(a, b, motion), ANGLE, 0.0)


@pytest.mark.parametrize("off", [(0.15, 0.0, 0.0), (0.0, 0.06, 0.0), (0.0, 0.0, -0.06), (np.pi, 0.0, 0.0)])
def test_the_true_motion_is_worth_more_than_one_that_is_off(looked, off: tuple) -> None:
    fine_search, truth, _ = looked
    assert fine_search.of(truth) > fine_search.of(truth + np.array([*off, 0.0])) + 0.1


def test_a_motion_under_which_the_views_do_not_meet_is_worth_least(looked) -> None:
    fine_search, truth, _ = looked
    assert fine_search.of(truth + np.array([0.0, 30.0, 0.0, 0.0])) == WORST


def test_a_motion_is_worth_what_the_views_and_the_shapes_like_and_what_is_hidden_less_what_floats(
    looked, monkeypatch: pytest.MonkeyPatch
) -> None:
    fine_search, truth, _ = looked
    motion = truth + np.array([0.0, 0.06, 0.0, 0.0])
    (source, target), (a, b), T = fine_search._views, fine_search._shapes, upright_pose(*fine_search._shapes, motion)
    seen = verify(source.sight, target.sight, T, RANKING_POINTS)
    ways = count_both_ways(source.sight, target.sight, T[None], RANKING_POINTS)
    (view_score,) = score_views_sharply(source, target, T[None], ways, RANKING_POINTS)
    assert seen.occluded > 0.05 and seen.violations > 0.01
    for silhouette_score, violations in ((0.0, 0.0), (2.0, 0.0), (0.0, 3.0)):
        monkeypatch.setattr(fine_search_module, "SILHOUETTE_WEIGHT_UPRIGHT", silhouette_score)
        monkeypatch.setattr(fine_search_module, "VIOLATION_WEIGHT_UPRIGHT", violations)
        more = silhouette_score * np.clip(score_silhouettes(a, b, motion), -1.0, 1.0) - violations * seen.violations
        assert FineSearch(source, target, a, b).of(motion) == pytest.approx(view_score + seen.occluded + more, abs=1e-6)


def test_a_thing_may_stand_farther_or_nearer_by_a_share_of_the_mean_of_both_extents(looked) -> None:
    fine_search, truth, _ = looked
    shifts = np.array(fine_search._taken_for(truth))[1 : 1 + 2 * len(ALONG)] - truth
    wide = 0.5 * sum(shape.extent for shape in fine_search._shapes)
    assert not shifts[:, [0, 3]].any()
    assert np.allclose(np.linalg.norm(shifts, axis=1), np.repeat(np.abs(ALONG), 2) * wide)


@pytest.mark.parametrize("off", [(0.08, 0.03, 0.02), (0.0, -0.08, 0.0), (np.pi, 0.0, 0.0)])
def test_it_finds_the_thickness_that_no_side_shows_and_what_was_taken_front_for_back(looked, off: tuple) -> None:
    fine_search, truth, error_of = looked
    motions, scores = fine_search.improved(truth[None] + np.array([*off, 0.0]))
    degrees, centimetres = error_of(motions[np.argmax(scores)])
    assert degrees < 5.0 and centimetres < 2.0


def test_it_leaves_the_motions_that_it_was_given_as_they_were(looked) -> None:
    fine_search, truth, _ = looked
    start = truth + np.array([0.1, 0.02, 0.0, 0.0])
    kept = start.copy()
    motions, scores = fine_search.improved(start[None])
    assert np.array_equal(start, kept)
    assert scores.max() >= fine_search.of(start) and 1 <= len(motions) == len(scores) <= SEARCHED


def test_what_is_hopeless_is_not_climbed(looked) -> None:
    fine_search, truth, _ = looked
    motions, scores = fine_search.improved(truth[None] + np.array([0.0, 30.0, 0.0, 0.0]))
    assert motions.shape == (0, 4) and scores.shape == (0,)
