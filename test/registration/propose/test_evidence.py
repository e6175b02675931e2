# SPDX-License-Identifier: Apache-2.0
"""What distinguishes two poses: neither what is hidden, nor that an object looks alike."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.certainty.observability import DOUBTFUL_SIGMA_M
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose import evidence
from objreg_ros.registration.propose.evidence import (
    OBJECT_BONUS,
    gather,
    margin_over,
    perturbation_margin_of,
    rank_score,
    score_objects,
    surroundings_of,
)
from objreg_ros.registration.score.comparison import SILHOUETTE_WEIGHT
from registration import rooms
from registration.samples import candidate

PARAMS = RegistrarParams()
BOX = (ObjectPair(0, 0, "cereal box"),)


def test_a_candidate_leads_by_what_its_views_are_worth_more() -> None:
    one, other = candidate(score=0.6, matched=BOX), candidate(score=0.4, matched=BOX)
    assert margin_over(one, [one, other]) == pytest.approx(0.2)
    assert margin_over(other, [one, other]) == pytest.approx(-0.2)


def test_what_is_hidden_counts_as_if_it_agreed() -> None:
    one, other = candidate(score=0.6, occluded=0.1), candidate(score=0.4, occluded=0.5)
    assert margin_over(one, [other]) == pytest.approx(-0.2)


def test_that_an_object_looks_alike_is_no_lead_and_that_it_looks_otherwise_is_none_to_have() -> None:
    alike, unseen, otherwise = (candidate(score=0.5, matched=BOX, silhouette_score=x) for x in (1.0, 0.0, -0.6))
    assert margin_over(alike, [unseen]) == pytest.approx(0.0)
    assert margin_over(alike, [otherwise]) == pytest.approx(0.6 * SILHOUETTE_WEIGHT)
    assert rank_score(alike).total - rank_score(unseen).total == pytest.approx(SILHOUETTE_WEIGHT)


def test_objects_that_stand_add_to_what_views_say_and_those_that_moved_take_away() -> None:
    assert score_objects(BOX, (), None) == pytest.approx((OBJECT_BONUS, 0.0))
    assert score_objects(BOX, BOX, 0.0) == pytest.approx((0.0, 0.0))
    assert score_objects(3 * BOX, 3 * BOX, 0.0) == pytest.approx((0.0, 0.0))  # two say all
    assert score_objects(BOX, 3 * BOX, 0.0) == pytest.approx((-OBJECT_BONUS, 0.0))


def test_without_a_competitor_a_candidate_leads_by_more_than_any_limit() -> None:
    assert margin_over(candidate(), []) > 2.0
    assert np.isfinite(margin_over(candidate(), []))


def test_a_pose_is_perturbed_where_surfaces_or_a_warped_depth_leave_it_doubtful(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    perturbations: list[tuple[Any, ...]] = []
    monkeypatch.setattr(evidence, "margin_under_perturbation", lambda *given: perturbations.append(given) or 0.25)
    variance = (2.0 * DOUBTFUL_SIGMA_M) ** 2
    warped = {"systematic_depth_error": np.diag([variance, 0, 0, 0, 0, 0])}
    degenerate = {"information": np.diag([1.0 / variance, 1e6, 1e6, 1e6, 1e6, 1e6])}
    for doubtful, resists in (({}, None), (warped, 0.25), (degenerate, 0.25)):
        views: Any = ("source", "target")
        assert perturbation_margin_of(candidate(**doubtful), *views) == resists
    assert [given[:2] for given in perturbations] == [views, views]
    assert [given[3][0, 0] for given in perturbations] == pytest.approx([variance, variance], rel=0.2)


@pytest.mark.parametrize(("here", "there"), [(True, True), (True, False), (False, True)])
def test_a_yaw_is_known_where_the_object_shows_it_in_both_views(here: bool, there: bool) -> None:
    ready = prepare(rooms.keyframe(rooms.seen_from(0.0)), PARAMS)
    views = (replace(ready, yaw_known=(known,) * len(ready.yaw_known)) for known in (here, there))
    found = gather(*views, candidate().alignment, ("features",))
    assert found.matched and found.yaw_known is (here and there)


def test_the_views_are_asked_without_the_objects_where_those_are_few(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(evidence, "verify_surroundings", lambda *given: asked.append(given) or "without")
    first, second, both = (
        np.array([[True, False, False]]),
        np.array([[False, False, True]]),
        np.array([[True, False, True]]),
    )
    source: Any = SimpleNamespace(sight="a", own=(first, second, first))
    target: Any = SimpleNamespace(sight="b", own=(second, first, first))
    cup, book, can = ObjectPair(0, 1, "cup"), ObjectPair(1, 0, "book"), ObjectPair(2, 2, "soda can")
    for matched, expected in (((cup,), "without"), ((cup, book), "without"), ((cup, book, can), None), ((), None)):
        assert surroundings_of(candidate(matched=matched), source, target) == expected
    for (*views, own, T), pixels in zip(asked, ((first, first), (both, both)), strict=True):
        assert views == ["a", "b"] and np.array_equal(own, pixels)
        assert np.array_equal(T, candidate().T_target_source)
