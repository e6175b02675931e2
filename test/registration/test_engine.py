# SPDX-License-Identifier: Apache-2.0
"""Tests of the pose engine on a room whose poses are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.data.frames import View
from objreg_ros.geometry import inverse, pose_error, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration import engine as engine_module
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.certainty import gravity_update
from objreg_ros.registration.certainty.covariance import spread_of
from objreg_ros.registration.engine import Engine, without_degeneracy
from objreg_ros.registration.keyframe import Context, Keyframe
from objreg_ros.registration.propose import competing_hypotheses
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN
from objreg_ros.registration.propose.shortlist import Shortlist
from objreg_ros.registration.score.view_score import LEAST_SCORE
from registration.rooms import ROOM, keyframe, seen_from
from registration.samples import candidate, moved

PARAMS = RegistrarParams()


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine(PARAMS)


@pytest.mark.parametrize("angle", [-35.0, 10.0, 30.0])
def test_a_place_seen_again_is_found_and_believed(engine: Engine, angle: float) -> None:
    source, target = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(angle), seed=2)
    best = engine.propose(source, target)[0]
    rotation, distance = pose_error(best.T_target_source, inverse(seen_from(angle)) @ seen_from(0.0))
    assert rotation < 1.0 and distance < 2.0
    assert best.verification.score > 0.3
    assert best.gravity_error_deg is not None and best.gravity_error_deg < 1.0


def test_the_other_way_round_is_the_inverse(engine: Engine) -> None:
    source, target = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2)
    best = engine.propose(target, source)[0]
    rotation, distance = pose_error(best.T_target_source, inverse(seen_from(0.0)) @ seen_from(20.0))
    assert rotation < 1.0 and distance < 2.0


def test_a_pose_is_brought_to_where_gravity_is_kept_as_far_as_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    source, target = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2)
    tilt = rotation_from_vector(np.radians([1.0, 0.0, 0.0]))
    tilted = replace(source, gravity=tilt @ source.gravity, gravity_confidence=1.0)
    errors, spreads = [], []
    for sigma_deg in (0.01, 10.0):
        monkeypatch.setattr(gravity_update, "MANY_VIEWS_DEG", sigma_deg)
        best = Engine(PARAMS).propose(tilted, replace(target, gravity_confidence=1.0))[0]
        errors.append(gravity_error(best.T_target_source, tilted, target))
        spreads.append(np.linalg.inv(best.alignment.information)[3:, 3:].trace())
    assert errors[0] < 0.1 and errors[1] > 0.8
    assert spreads[0] < spreads[1]


def test_what_is_said_besides_makes_the_whole_covariance_smaller_and_leaves_a_covariance_of_the_warp(
    engine: Engine,
) -> None:
    systematic_depth_error, added = (
        np.diag([0.04, 0.01, 0.0, 0.0, 0.0, 0.02]),
        np.diag([100.0, 0.0, 0.0, 0.0, 400.0, 0.0]),
    )
    doubtful = candidate(information=1e3 * np.eye(6), systematic_depth_error=systematic_depth_error)
    alone = spread_of(doubtful.alignment)
    informed = engine._informed(doubtful, added)
    assert np.array_equal(informed.alignment.information, doubtful.alignment.information + added)
    whole = np.linalg.inv(np.linalg.inv(alone) + added) + informed.systematic_depth_error
    np.testing.assert_allclose(whole, np.linalg.inv(np.linalg.inv(alone + systematic_depth_error) + added), atol=1e-12)
    assert np.linalg.eigvalsh(informed.systematic_depth_error).min() > -1e-12


def test_a_pose_is_regularised_where_it_was_perturbed_and_does_not_slide(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine_module, "regularising_information", lambda *_: 100.0 * np.eye(6))
    pair: Any = SimpleNamespace(source=None, target=None)
    for one, more in (
        (candidate(perturbation_margin=0.3), 100.0),
        (candidate(perturbation_margin=None), 0.0),
        (candidate(perturbation_margin=0.3, degenerate=np.eye(6)[:1]), 0.0),
    ):
        added = engine._regularised(pair, one).alignment.information - one.alignment.information
        np.testing.assert_allclose(added, more * np.eye(6), atol=1e-9)


def test_what_else_a_lone_objects_pose_could_be_is_a_competitor_unless_it_comes_to_one_that_is_known(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = [candidate(moved(x), matched=(ObjectPair(0, 0, "cup"),)) for x in (0.0, 1.0)]
    others = {0.0: [moved(0.5), moved(0.1)], 1.0: [moved(-0.1), moved(1.5)]}
    monkeypatch.setattr(engine_module, "competing_poses", lambda s, t, one: others[one.T_target_source[0, 3]])
    monkeypatch.setattr(engine_module, "refine", lambda s, t, T: candidate(T).alignment)
    monkeypatch.setattr(engine, "_gathered", lambda pair, found, proposers: (found.T_target_source[0, 3], proposers))
    pair: Any = SimpleNamespace(source=SimpleNamespace(middle=np.zeros(3)), target=None)
    assert engine._competitors(pair, known) == [(0.5, ("objects",)), (1.5, ("objects",))]
    assert engine._competitors(pair, []) == []


@pytest.mark.parametrize(("yaw_known", "silhouette_score", "left"), [(True, 1.0, 0), (False, 1.0, 1), (True, -1.0, 1)])
def test_an_object_that_shows_its_yaw_and_looks_alike_takes_away_the_degenerate_direction(
    yaw_known: bool, silhouette_score: float, left: int
) -> None:
    one = candidate(yaw_known=yaw_known, silhouette_score=silhouette_score, degenerate=np.eye(6)[:1])
    engine = Engine(PARAMS, score=lambda *_: one)
    pair: Any = SimpleNamespace(source=None, target=None)
    assert len(engine._gathered(pair, one.alignment, ("objects",)).alignment.degenerate) == left


def test_the_true_pose_has_keypoints_that_agree_and_no_rival_has_as_many() -> None:
    seen = [keyframe(seen_from(angle), seed=k) for k, angle in enumerate((0.0, 20.0))]
    best = Engine(PARAMS).propose(*seen)[0]
    assert best.keypoints is not None and "keypoints" in best.agreeing_proposers
    assert best.keypoints.cells >= 6 and best.keypoints.cells > best.keypoints.rival_cells + 2
    dark = [replace(one, view=replace(one.view, grey=None)) for one in seen]
    assert all(one.keypoints is None for one in Engine(PARAMS).propose(*dark))


def test_a_proposer_of_ones_own_is_asked_instead_of_ours() -> None:
    asked: list[object] = []

    def none(pair: object, prior: object) -> Shortlist:
        asked.append(prior)
        return Shortlist((), ())

    pair = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2)
    assert Engine(PARAMS, propose=none).propose(*pair) == () and asked == [None]


def test_a_pose_that_one_proposer_came_to_does_not_become_two_proposers_by_what_is_found_about_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lone = tuple(box for box in ROOM if box[0] not in ("book", "cup", "keyboard"))
    source, target = keyframe(seen_from(0.0), lone, seed=1), keyframe(seen_from(20.0), lone, seed=2)
    with_search = Engine(PARAMS).propose(source, target)
    monkeypatch.setattr(competing_hypotheses, "REFINED", 0)
    without = Engine(PARAMS).propose(source, target)
    assert with_search[0].agreeing_proposers == without[0].agreeing_proposers
    assert np.array_equal(with_search[0].T_target_source, without[0].T_target_source)


def test_the_competitors_of_promising_candidates_are_ranked_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, asked = Engine(PARAMS), []
    competitor = candidate(moved(0.0, 0.0, 3.0), score=9.0)
    monkeypatch.setattr(engine, "_competitors", lambda pair, promising: asked.extend(promising) or [competitor])
    monkeypatch.setattr(engine, "_perturbed", lambda pair, one: one)
    monkeypatch.setattr(engine, "_gravity_updated", lambda pair, one: one)
    found = engine.propose(keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2))
    assert np.array_equal(found[0].T_target_source, competitor.T_target_source) and len(found) > 1
    least = max(LEAST_SCORE, max(one.verification.score for one in asked) - CONSIDERED_MARGIN)
    assert asked and all(one.verification.score >= least for one in asked)
    assert found[0].score_margin < 9.0  # another one is known


def test_what_is_held_has_no_degenerate_direction_at_all() -> None:
    assert without_degeneracy(candidate(degenerate=np.eye(6)[:2]).alignment).degenerate.shape == (0, 6)


def gravity_error(T_target_source: np.ndarray, source: Keyframe, target: Keyframe) -> float:
    assert source.gravity is not None and target.gravity is not None
    return float(np.degrees(np.arccos(np.clip(T_target_source[:3, :3] @ source.gravity @ target.gravity, -1.0, 1.0))))


def test_objects_that_stand_still_are_matched(engine: Engine) -> None:
    best = engine.propose(keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2))[0]
    assert {pair.label for pair in best.matched} >= {"book", "cup", "bottle"}
    assert best.moved == ()


def test_an_object_that_moved_is_reported_and_outvoted(engine: Engine) -> None:
    changed = tuple(("bottle", (1.5, 0.6, 0.72), (1.58, 0.68, 1.0)) if box[0] == "bottle" else box for box in ROOM)
    best = engine.propose(keyframe(seen_from(0.0), seed=1), keyframe(seen_from(15.0), changed, seed=2))[0]
    rotation, distance = pose_error(best.T_target_source, inverse(seen_from(15.0)) @ seen_from(0.0))
    assert rotation < 1.0 and distance < 2.0
    assert [pair.label for pair in best.moved] == ["bottle"]


def test_a_prior_is_a_proposer_of_its_own(engine: Engine) -> None:
    source, target = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(15.0), seed=2)
    truth = inverse(seen_from(15.0)) @ seen_from(0.0)
    best = engine.propose(source, target, truth)[0]
    assert "odometry" in best.agreeing_proposers and len(best.agreeing_proposers) >= 2


def test_the_same_keyframes_give_the_same_candidates() -> None:
    source, target = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(25.0), seed=2)
    first, second = (Engine(RegistrarParams()).propose(source, target) for _ in range(2))
    assert len(first) == len(second)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.T_target_source, b.T_target_source)
        assert a.verification == b.verification


def test_without_gravity_and_grey_there_is_still_a_pose(engine: Engine) -> None:
    source = keyframe(seen_from(0.0), seed=1, gravity=False, grey=False)
    target = keyframe(seen_from(15.0), seed=2, gravity=False, grey=False)
    best = engine.propose(source, target)[0]
    rotation, distance = pose_error(best.T_target_source, inverse(seen_from(15.0)) @ seen_from(0.0))
    assert rotation < 1.5 and distance < 3.0
    assert best.verification.correlation is None and best.gravity_error_deg is None


def test_an_empty_keyframe_proposes_nothing(engine: Engine) -> None:
    full = keyframe(seen_from(0.0))
    nothing = np.zeros((0, 3), np.float32)
    dark = View(xyz=np.full_like(full.view.xyz, np.nan), grey=None, intrinsics=full.view.intrinsics)
    empty = replace(full, objects=(), context=Context(xyz=nothing, normals=nothing), view=dark)
    assert engine.propose(full, empty) == () == engine.propose(empty, full)


def test_what_is_small_counts_too(engine: Engine) -> None:
    prepared = engine._cache.get(keyframe(seen_from(0.0), seed=1))
    cup = next(item.cloud.xyz for item in prepared.keyframe.objects if item.label == "cup")
    near = np.linalg.norm(prepared.xyz[:, None] - cup[None, ::4], axis=-1).min(axis=1) < 0.02
    assert near.sum() >= 5
