# SPDX-License-Identifier: Apache-2.0
"""Tests of what else a lone object's pose could be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, pose_error, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate, ObjectPair
from objreg_ros.registration.certainty.perturbation import turned_about
from objreg_ros.registration.kernels.same_pose import AGREEING, STARTS, near
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from objreg_ros.registration.propose import competing_hypotheses as module
from objreg_ros.registration.propose.competing_hypotheses import _grid, competing_poses
from objreg_ros.registration.propose.evidence import FINISHED_MARGIN, gather
from objreg_ros.registration.propose.refinement import refine
from registration.rooms import ROOM, keyframe, seen_from
from registration.samples import candidate, moved

PARAMS = RegistrarParams()
LONE = tuple(box for box in ROOM if box[0] not in ("book", "cup", "keyboard"))
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
CUP = ObjectPair(0, 0, "cup")


@pytest.fixture(scope="module")
def views() -> tuple[Prepared, Prepared]:
    """A bottle on a table, seen from two sides."""
    source, target = (prepare(keyframe(seen_from(angle), LONE, seed=k), PARAMS) for k, angle in enumerate((0.0, 20.0)))
    assert source.keyframe.labels == target.keyframe.labels == ("bottle",)
    return source, target


def beside(views: tuple[Prepared, Prepared], turn_deg: float, sideways: float) -> Candidate:
    """The candidate of a pose that is wrong by so much about the bottle, which it explains."""
    source, target = views
    middle, up = transform(TRUTH, source.centroids[0]), np.asarray(target.up)
    across = np.cross(up, middle) / np.linalg.norm(np.cross(up, middle))
    T = pose(np.eye(3), sideways * across) @ turned_about(TRUTH, middle, up, np.radians([turn_deg]))[0]
    found = gather(source, target, replace(refine(source, target, TRUTH), T_target_source=T), ("objects",))
    return replace(found, matched=(ObjectPair(0, 0, "bottle"),))


def errors(found: list[Array]) -> list[tuple[float, float]]:
    return [pose_error(T, TRUTH) for T in found]


@pytest.mark.parametrize(("turn_deg", "sideways"), [(12.0, 0.1), (-10.0, 0.0), (0.0, 0.19)])
def test_the_truth_is_found_beside_a_wrong_pose(
    views: tuple[Prepared, Prepared], turn_deg: float, sideways: float
) -> None:
    found = competing_poses(*views, beside(views, turn_deg, sideways))
    assert any(degrees < 1.0 and centimetres < 2.0 for degrees, centimetres in errors(found))


def test_the_search_begins_where_poses_do_not_agree_with_the_candidate_and_far_from_each_other(
    views: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "half_turned", lambda *_: None)
    monkeypatch.setattr(module, "finish", lambda source, target, T, *_: (T, np.zeros((6, 6))))
    monkeypatch.setattr(module, "_is_hopeful", lambda *_: True)
    monkeypatch.setattr(module, "REFINED", 30)
    starts = np.array(competing_poses(*views, beside(views, 0.0, 0.0)))
    middle = views[0].middle
    assert len(starts) == 30
    assert not near(starts, TRUTH, middle, AGREEING).any()
    for k, start in enumerate(starts):
        assert np.flatnonzero(near(starts, start, middle, STARTS)).tolist() == [k]


def test_what_views_like_far_less_is_no_competing_pose(
    views: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = beside(views, 12.0, 0.1)
    spoiled = replace(wrong.verification, score=5.0)
    assert competing_poses(*views, wrong)
    assert competing_poses(*views, replace(wrong, verification=spoiled)) == []


def test_without_grey_in_both_views_nothing_is_looked_for_around(
    views: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "half_turned", lambda *_: None)
    source, target = views
    blind_source, blind_target = (replace(view, sight=replace(view.sight, textured=False)) for view in views)
    wrong = beside(views, 12.0, 0.1)
    assert competing_poses(blind_source, target, wrong) == []
    assert competing_poses(source, blind_target, wrong) == []


@pytest.mark.parametrize("matched", [(), (CUP, ObjectPair(1, 1, "book"))])
def test_none_is_looked_for_where_not_one_object_speaks_for_a_pose(matched: tuple[ObjectPair, ...]) -> None:
    nothing: Any = None
    assert competing_poses(nothing, nothing, candidate(matched=matched)) == []


def test_without_gravity_and_where_none_are_wanted_nothing_is_looked_for_around(
    views: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "half_turned", lambda *_: None)
    source, target = views
    wrong = beside(views, 12.0, 0.1)
    assert competing_poses(source, target, wrong)
    assert competing_poses(source, replace(target, up=None), wrong) == []
    monkeypatch.setattr(module, "REFINED", 0)
    assert competing_poses(source, target, wrong) == []


def test_the_grid_is_upright_turns_about_the_object_and_shifts_across_the_vertical(
    views: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    source, target = views
    monkeypatch.setattr(module, "TURNS_DEG", (10.0,))
    monkeypatch.setattr(module, "SEARCH_STEP_M", 0.1)
    monkeypatch.setattr(module, "SEARCH_STEPS", 1)
    grid = _grid(source, target, beside(views, 0.0, 0.0))
    steps = np.array([transform(T, source.centroids[0]) - transform(TRUTH, source.centroids[0]) for T in grid])
    lengths = np.linalg.norm(steps, axis=1).reshape(3, 9)
    assert grid.shape == (27, 4, 4)
    np.testing.assert_allclose(steps @ np.asarray(target.up), 0.0, atol=1e-6)
    np.testing.assert_allclose(np.sort(lengths), np.tile(0.1 * np.sqrt([0, 1, 1, 1, 1, 2, 2, 2, 2]), (3, 1)), atol=1e-6)
    turns = sorted(round(pose_error(T, TRUTH)[0], 6) for T in grid)
    np.testing.assert_allclose(turns, [0.0] * 9 + [10.0] * 18, atol=1e-4)


@pytest.mark.parametrize(("share", "violations", "count"), [(0.9, 0.0, 1), (1.1, 0.0, 0), (0.9, 0.15, 0)])
def test_a_half_turn_is_hopeful_where_it_is_not_far_behind_nor_floats(
    monkeypatch: pytest.MonkeyPatch, share: float, violations: float, count: int
) -> None:
    one, half = candidate(matched=(CUP,), score=0.8, occluded=0.1), moved(0.4)
    behind = share * FINISHED_MARGIN
    seen = replace(one.verification, score=0.8 + 0.1 - 0.3 - behind, occluded=0.3, violations=violations)
    monkeypatch.setattr(module, "half_turned", lambda *_: half)
    monkeypatch.setattr(module, "verify", lambda source, target, T, *_: seen if T is half else None)
    blind: Any = SimpleNamespace(sight=SimpleNamespace(textured=False), up=None)
    assert competing_poses(blind, blind, one) == count * [half]
