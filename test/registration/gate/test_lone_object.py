# SPDX-License-Identifier: Apache-2.0
"""A lone object: what confirms its pose, and what else is asked of it."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.gate import lone_object
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import refuse
from objreg_ros.registration.propose.evidence import OBJECT_BONUS
from registration.gate.samples import CUP, competitor, lone
from registration.samples import candidate

LIMITS = lone_object.Limits(tested=2000, firmness=1.0, yaw_bonus=0.25, objects=2, proposers=2)
LOOKS = lone_object.AppearanceLimits(0.1, -0.2, 0.5, 0.45)


def test_only_a_lone_object_is_asked_for_more_overlap() -> None:
    assert (
        lone_object.check_overlap(1999, False, LIMITS) is None and lone_object.check_overlap(2000, True, LIMITS) is None
    )
    assert lone_object.check_overlap(1999, True, LIMITS) == (
        Reason.LOW_OVERLAP,
        "1 object and 1999 pixels tested < 2000",
    )


@pytest.mark.parametrize(
    ("score", "perturbation_margin", "yaw_known", "lone", "firm"),
    [
        (0.5, 0.5, False, True, True),
        (0.5, 0.49, False, True, False),
        (0.5, 0.26, True, True, True),
        (0.5, 0.24, True, True, False),
        (0.5, 0.0, False, False, True),
        (0.1, None, False, True, True),
    ],
)
def test_view_score_and_margin_under_perturbation_together_make_a_lone_pose_firm(
    score: float, perturbation_margin: float | None, yaw_known: bool, lone: bool, firm: bool
) -> None:
    refusal = lone_object.check_firm(score, perturbation_margin, yaw_known, lone, LIMITS)
    assert (refusal is None) is firm and (firm or refusal[0] is Reason.CHAINS_DISAGREE)


@pytest.mark.parametrize(
    ("look", "confirmed"),
    [
        ((0.1, True, None, 0.0), True),
        ((0.09, True, None, 9.0), False),
        ((0.1, False, None, 9.0), False),
        ((-0.2, True, 0.3, 0.0), True),
        ((-0.2, False, 0.5, 0.0), True),
        ((-0.3, True, 0.5, 0.44), False),
        ((None, False, 0.5, 0.45), True),
        ((None, True, 0.49, 9.0), False),
    ],
)
def test_the_object_or_the_grey_confirms_a_pose(look: tuple, confirmed: bool) -> None:
    assert lone_object.is_confirmed(lone_object.Appearance(*look), LOOKS) is confirmed


def test_the_appearance_of_a_candidate_is_its_evidence() -> None:
    one = candidate(silhouette_score=0.3, yaw_known=True, texture=0.7, margin_over_competing=0.9)
    assert lone_object.appearance_of(one) == (0.3, True, 0.7, 0.9)


def test_one_object_closes_a_loop_when_grey_holds_the_pose_and_no_other_comes_near() -> None:
    least = GATE.appearance.correlation
    assert refuse(candidate(matched=(CUP,), margin_over_competing=1.0, texture=least + 0.01)) is None
    for doubt in ({"margin_over_competing": 0.3}, {"texture": least - 0.01}, {"texture": None}):
        refusal = refuse(candidate(**{"matched": (CUP,), "margin_over_competing": 1.0, **doubt}))
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_a_lone_object_without_a_yaw_needs_grey_that_tells_it() -> None:
    alone = {"matched": (CUP,), "margin_over_competing": 1.0, "silhouette_score": 0.5}
    for yaw_known, beyond, accepted in ((True, -0.1, True), (False, -0.1, False), (False, 0.01, True)):
        told = {"yaw_known": yaw_known, "texture": GATE.appearance.correlation + beyond}
        assert (refuse(candidate(**alone, **told)) is None) is accepted


def test_a_lone_object_that_one_proposer_proposed_must_be_seen_with_more_of_the_views() -> None:
    for proposers, tested, accepted in (
        (("objects",), GATE.lone_object.tested - 1, False),
        (("objects",), GATE.lone_object.tested, True),
        (("features", "objects"), GATE.lone_object.tested - 1, True),
    ):
        lone = candidate(
            matched=(CUP,),
            margin_over_competing=1.0,
            perturbation_margin=1.0,
            agreeing_proposers=proposers,
            tested=tested,
            yaw_known=True,
        )
        refusal = refuse(lone)
        assert (refusal is None) is accepted, (proposers, tested, refusal)
        assert refusal is None or (refusal[0] is Reason.LOW_OVERLAP and f"{GATE.lone_object.tested}" in refusal[1])


def test_a_lone_object_of_one_proposer_needs_views_that_like_it_and_every_perturbation_of_it_less() -> None:
    liked = {
        "score": 1.2 * GATE.view_score.least_doubtful,
        "margin_over_competing": 1.0,
        "matched": (CUP,),
        "silhouette_score": 0.9,
    }
    lacking = GATE.lone_object.firmness - liked["score"]
    for proposers, perturbation_margin, accepted in (
        (("objects",), 0.9 * lacking, False),
        (("centroids", "objects"), 0.9 * lacking, False),
        (("objects", "odometry"), 0.9 * lacking, False),
        (("objects",), 1.1 * lacking, True),
        (("objects",), None, True),
        (("features", "objects"), 0.9 * lacking, True),
    ):
        refusal = refuse(candidate(agreeing_proposers=proposers, perturbation_margin=perturbation_margin, **liked))
        assert (refusal is None) is accepted, (proposers, perturbation_margin, refusal)
        assert refusal is None or refusal[0] is Reason.CHAINS_DISAGREE


def test_a_lone_object_that_tells_its_yaw_makes_up_for_a_perturbation_that_is_resisted_less() -> None:
    liked = {
        "score": 1.2 * GATE.view_score.least_doubtful,
        "margin_over_competing": 1.0,
        "matched": (CUP,),
        "silhouette_score": 0.9,
    }
    lacking = GATE.lone_object.firmness - liked["score"]
    for yaw_known, perturbation_margin, accepted in (
        (True, lacking - 0.9 * OBJECT_BONUS, True),
        (True, lacking - 1.1 * OBJECT_BONUS, False),
        (False, lacking - 0.9 * OBJECT_BONUS, False),
    ):
        telling = candidate(
            agreeing_proposers=("objects",), perturbation_margin=perturbation_margin, yaw_known=yaw_known, **liked
        )
        assert (refuse(telling) is None) is accepted, (yaw_known, perturbation_margin)


def test_a_lone_object_that_is_unmistakable_needs_no_second_proposer() -> None:
    assert refuse(lone()) is None


@pytest.mark.parametrize(
    "doubt", [{"yaw_known": False}, {"silhouette_score": -0.1}, {"silhouette_score": None}], ids=str
)
def test_proposers_that_agree_in_a_plain_room_do_not_speak_for_an_object_that_could_be_another(doubt: dict) -> None:
    doubted = lone(**doubt, margin_over_competing=0.1, agreeing_proposers=("features", "objects"))
    refusal = refuse(doubted, possible=[competitor(doubted, 0.1)])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE
    assert refuse(lone(**{**doubt, "texture": 0.6, "margin_over_competing": 0.6})) is None


def test_an_object_that_looks_otherwise_is_another_however_good_its_pose() -> None:
    refusal = refuse(lone(silhouette_score=GATE.appearance.silhouette_score_with_grey - 0.1, margin_over_competing=3.0))
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_without_grey_a_lone_object_has_to_tell_its_yaw_and_look_alike() -> None:
    assert refuse(lone(texture=None)) is None
    for doubt in ({"yaw_known": False}, {"silhouette_score": -0.1}):
        refusal = refuse(lone(texture=None, **doubt))
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE
