# SPDX-License-Identifier: Apache-2.0
"""The view score, and what makes up for a low one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import ObjectPair, Verification
from objreg_ros.registration.gate import view_score
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import refuse
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN
from objreg_ros.registration.score.view_score import LEAST_SCORE
from registration.gate.samples import CUP
from registration.samples import candidate

LIMITS = view_score.Limits(least=0.1, least_doubtful=0.4, violations=0.02, firm_margin=0.4, silhouette_weight=0.5)


@pytest.mark.parametrize(
    ("violations", "perturbation_margin", "lone", "least"),
    [
        (0.9, None, False, 0.1),
        (0.0, None, True, 0.4),
        (0.02, 0.0, True, 0.1),
        (0.03, 0.0, False, 0.4),
        (0.03, 0.3, False, 0.2),
        (0.03, 0.5, False, 0.1),
    ],
)
def test_a_margin_under_perturbation_makes_up_for_violations(
    violations: float, perturbation_margin: float | None, lone: bool, least: float
) -> None:
    assert view_score.least_total(violations, perturbation_margin, lone, LIMITS) == pytest.approx(least)


def test_silhouettes_add_to_a_view_score_that_is_high_enough_by_itself() -> None:
    seen = Verification(inliers=0.9, violations=0.0, occluded=0.0, texture=0.6, tested=9000, score=0.2)
    assert view_score.check(seen, 0.5, None, True, LIMITS) is None
    for silhouette_score in (0.3, -1.0, None):
        refusal = view_score.check(seen, silhouette_score, None, True, LIMITS)
        assert refusal is not None and refusal[1].startswith("score with likeness")
    low = view_score.check(replace(seen, score=0.09), 1.0, None, True, LIMITS)
    assert low == (Reason.LOW_OVERLAP, "score 0.09 < 0.10")


def test_where_something_floats_the_fall_over_a_perturbation_makes_up_for_a_low_score() -> None:
    certain_violations = 1.5 * GATE.view_score.violations
    little = {
        "score": 0.5 * (LEAST_SCORE + GATE.view_score.least_doubtful),
        "margin_over_competing": 1.0,
        "violations": certain_violations,
    }
    lacking = GATE.observability.firm_margin - (little["score"] - LEAST_SCORE)
    for matched, perturbation_margin, accepted in (
        ((CUP,), 0.9 * lacking, False),
        ((CUP,), 1.1 * lacking, True),
        ((CUP,), None, True),
        ((CUP, ObjectPair(1, 1, "book")), 0.9 * lacking, False),
    ):
        refusal = refuse(candidate(matched=matched, perturbation_margin=perturbation_margin, **little))
        assert (refusal is None) is accepted, (matched, perturbation_margin, refusal)


def test_a_pose_that_views_like_well_need_not_resist_though_something_floats() -> None:
    certain_violations = {
        "violations": 1.5 * GATE.view_score.violations,
        "matched": (CUP, ObjectPair(1, 1, "book")),
    }
    liked = candidate(
        score=1.1 * GATE.view_score.least_doubtful, perturbation_margin=1.1 * CONSIDERED_MARGIN, **certain_violations
    )
    assert refuse(liked) is None


def test_a_lone_object_that_views_like_little_need_not_resist_a_perturbation_where_next_to_nothing_floats() -> None:
    little = {
        "score": 0.5 * (LEAST_SCORE + GATE.view_score.least_doubtful),
        "margin_over_competing": 1.0,
        "matched": (CUP,),
    }
    soft = candidate(
        perturbation_margin=0.9 * GATE.observability.firm_margin,
        violations=0.5 * GATE.view_score.violations,
        **little,
    )
    assert refuse(soft) is None


def test_a_lone_object_that_views_like_little_needs_two_proposers() -> None:
    little = {
        "score": 0.5 * (LEAST_SCORE + GATE.view_score.least_doubtful),
        "margin_over_competing": 1.0,
        "matched": (CUP,),
    }
    for proposers in (
        ("objects",),
        ("centroids", "objects"),
    ):  # the objects' poses are looked for from their middles too
        refusal = refuse(candidate(agreeing_proposers=proposers, **little))
        assert refusal is not None and refusal[0] is Reason.LOW_OVERLAP
    assert refuse(candidate(agreeing_proposers=("features", "objects"), **little)) is None


def test_a_lone_object_of_one_proposer_is_refused_where_views_like_too_little_however_alike_it_looks() -> None:
    firm = {"perturbation_margin": GATE.lone_object.firmness, "agreeing_proposers": ("objects",), "matched": (CUP,)}
    for score, accepted in ((1.1, True), (0.9, False)):
        alike = candidate(score=score * LEAST_SCORE, silhouette_score=1.0, margin_over_competing=1.0, **firm)
        refusal = refuse(alike)
        assert (refusal is None) is accepted, (score, refusal)
        assert refusal is None or refusal[0] is Reason.LOW_OVERLAP


def test_a_lone_object_of_one_proposer_that_views_like_little_must_resist_a_perturbation() -> None:
    score = 0.5 * (LEAST_SCORE + GATE.view_score.least_doubtful)
    for perturbation_margin, accepted in ((GATE.lone_object.firmness, True), (0.0, False), (None, False)):
        little = {
            "score": score,
            "silhouette_score": 0.0,
            "margin_over_competing": 1.0,
            "matched": (CUP,),
            "agreeing_proposers": ("objects",),
        }
        refusal = refuse(candidate(perturbation_margin=perturbation_margin, **little))
        assert (refusal is None) is accepted, (perturbation_margin, refusal)


def test_an_object_that_looks_alike_makes_up_for_views_that_like_little() -> None:
    little = {
        "score": 0.2,
        "violations": 1.5 * GATE.view_score.violations,
        "yaw_known": True,
        "margin_over_competing": 1.0,
    }
    little["perturbation_margin"] = 0.3 * GATE.observability.firm_margin
    alike, otherwise = (
        candidate(matched=(CUP,), silhouette_score=silhouette_score, **little) for silhouette_score in (1.0, 0.2)
    )
    assert refuse(alike) is None
    refusal = refuse(otherwise)
    assert refusal is not None and refusal[0] is Reason.LOW_OVERLAP


def test_an_object_that_looks_otherwise_takes_nothing_from_what_views_like() -> None:
    assert refuse(candidate(score=1.1 * LEAST_SCORE, silhouette_score=-1.0)) is None
