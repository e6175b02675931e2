# SPDX-License-Identifier: Apache-2.0
"""The gate: what it lets through, and why it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data import Reason
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registration.candidate import Candidate, ObjectPair
from objreg_ros.registration.gate.verdict import judge, refuse
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.propose.prior import Prior
from registration.samples import candidate, moved

PARAMS = RegistrarParams()
CUP = ObjectPair(0, 0, "cup")


def test_a_candidate_that_nothing_speaks_against_is_accepted() -> None:
    assert refuse(candidate(), PARAMS) is None


@pytest.mark.parametrize(
    ("evidence", "reason"),
    [
        ({"converged": False}, Reason.NOT_CONVERGED),
        ({"T": moved(100.0)}, Reason.IMPLAUSIBLE_MOTION),
        ({"gravity_error_deg": 30.0}, Reason.GRAVITY),
        ({"tested": 20}, Reason.LOW_OVERLAP),
        ({"inliers": 0.1}, Reason.LOW_OVERLAP),
        ({"violations": 0.5}, Reason.FREE_SPACE),
        ({"texture": -0.2}, Reason.TEXTURE),
        ({"score": -1.0}, Reason.LOW_OVERLAP),
        ({"agreeing_chains": ("objects",), "explained": (CUP,)}, Reason.CHAINS_DISAGREE),
        ({"agreeing_chains": ("features",), "explained": ()}, Reason.FEW_OBJECTS),
        ({"agreeing_chains": ("features",), "explained": (), "resistance": 0.1}, Reason.FEW_OBJECTS),
        ({"explained": (), "moved": (CUP,)}, Reason.MOVED),
        ({"information": np.diag([1.0, 1e5, 1e5, 1e5, 1e5, 1e5])}, Reason.SLACK),
        ({"slack": np.eye(6)[:1]}, Reason.SLACK),
        ({"resistance": 0.02}, Reason.SLACK),
    ],
)
def test_each_kind_of_evidence_alone_can_refuse(evidence: dict[str, object], reason: Reason) -> None:
    refusal = refuse(candidate(**evidence), PARAMS)
    assert refusal is not None and refusal[0] is reason
    assert any(letter.isdigit() for letter in refusal[1])


def test_gravity_may_tilt_by_what_the_planes_of_two_views_err_and_no_more() -> None:
    most = PARAMS.max_gravity_error
    assert most < 4.0
    assert refuse(candidate(gravity_error_deg=most - 0.1), PARAMS) is None
    refusal = refuse(candidate(gravity_error_deg=most + 0.1), PARAMS)
    assert refusal is not None and refusal[0] is Reason.GRAVITY


def test_a_candidate_without_grey_or_gravity_is_judged_by_the_rest() -> None:
    assert refuse(candidate(texture=None, gravity_error_deg=None), PARAMS) is None


def test_one_object_closes_a_loop_when_grey_holds_the_pose_and_no_other_comes_near() -> None:
    least = PARAMS.min_texture_painted
    assert refuse(candidate(explained=(CUP,), margin=1.0, texture=least + 0.01), PARAMS) is None
    for doubt in ({"margin": 0.3}, {"texture": least - 0.01}, {"texture": None}):
        refusal = refuse(candidate(**{"explained": (CUP,), "margin": 1.0, **doubt}), PARAMS)
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_a_lone_object_without_a_yaw_needs_grey_that_tells_it() -> None:
    alone = {"explained": (CUP,), "margin": 1.0, "likeness": 0.5}
    for yaw_known, beyond, accepted in ((True, -0.1, True), (False, -0.1, False), (False, 0.01, True)):
        told = {"yaw_known": yaw_known, "texture": PARAMS.min_texture_painted + beyond}
        assert (refuse(candidate(**alone, **told), PARAMS) is None) is accepted


def test_a_lone_object_must_respect_free_space_more_than_several() -> None:
    far = {"floating": 0.5 * (PARAMS.max_floating_alone + PARAMS.max_floating)}
    refusal = refuse(candidate(explained=(CUP,), margin=1.0, **far), PARAMS)
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
    assert refuse(candidate(**far), PARAMS) is None


@pytest.mark.parametrize(
    ("around", "reason"),
    [
        ({"texture": -0.1}, Reason.TEXTURE),
        ({"violations": 1.1 * PARAMS.max_violations}, Reason.FREE_SPACE),
        ({"inliers": 0.5 * PARAMS.min_inliers}, Reason.LOW_OVERLAP),
        ({"tested": PARAMS.min_tested - 1}, Reason.LOW_OVERLAP),
        ({"score": -1.0}, None),  # what is little scores little
        ({}, None),
    ],
)
@pytest.mark.parametrize("explained", [(CUP,), (CUP, ObjectPair(1, 1, "book"))], ids=len)
def test_what_is_around_few_objects_must_agree_by_itself(
    around: dict[str, float], reason: Reason | None, explained: tuple[ObjectPair, ...]
) -> None:
    few = candidate(explained=explained, margin=1.0, surroundings=replace(candidate().verification, **around))
    refusal = refuse(few, PARAMS)
    assert (None if refusal is None else refusal[0]) is reason
    assert refusal is None or refusal[1].startswith(
        ("without the cup ", "without the cup and the book ")[len(explained) - 1]
    )


@pytest.mark.parametrize("chains", [("features", "objects"), ("objects",)], ids=len)
@pytest.mark.parametrize("explained", [(CUP,), (CUP, ObjectPair(1, 1, "book"))], ids=len)
def test_few_objects_around_which_the_print_agrees_much_less_have_moved(
    explained: tuple[ObjectPair, ...], chains: tuple[str, ...]
) -> None:
    def judged(around: float | None, whole: float | None = 0.6) -> object:
        seen = replace(candidate().verification, texture=whole)
        told = {"explained": explained, "agreeing_chains": chains, "margin": 1.0, "yaw_known": True, "likeness": 0.9}
        surroundings = replace(seen, texture=around)
        return refuse(candidate(**told, texture=whole, resistance=1.0, surroundings=surroundings), PARAMS)

    assert judged(0.6 - 0.9 * PARAMS.max_fall_around) is None
    assert judged(0.99) is None
    assert judged(None) is None and judged(None, None) is None
    refusal = judged(0.6 - 1.1 * PARAMS.max_fall_around)
    assert isinstance(refusal, tuple) and refusal[0] is Reason.TEXTURE and "without the cup" in refusal[1]


def test_a_lone_object_that_one_chain_proposed_must_be_seen_with_more_of_the_views() -> None:
    for chains, tested, accepted in (
        (("objects",), PARAMS.min_tested_alone - 1, False),
        (("objects",), PARAMS.min_tested_alone, True),
        (("features", "objects"), PARAMS.min_tested_alone - 1, True),
    ):
        lone = candidate(
            explained=(CUP,), margin=1.0, resistance=1.0, agreeing_chains=chains, tested=tested, yaw_known=True
        )
        refusal = refuse(lone, PARAMS)
        assert (refusal is None) is accepted, (chains, tested, refusal)
        assert refusal is None or (refusal[0] is Reason.LOW_OVERLAP and f"{PARAMS.min_tested_alone}" in refusal[1])


def test_two_objects_that_one_chain_brought_together_leave_more_to_a_push() -> None:
    two, three = (tuple(ObjectPair(k, k, "cup") for k in range(n)) for n in (2, 3))
    short = PARAMS.rival_margin * (0.5 + 0.5 * PARAMS.doubt_factor)
    for explained, chains, accepted in (
        (two, ("objects",), False),
        (two, ("objects", "odometry"), False),
        (two, ("centroids", "features"), True),
        (three, ("objects",), True),
    ):
        refusal = refuse(candidate(explained=explained, agreeing_chains=chains, resistance=short), PARAMS)
        assert (refusal is None) is accepted, (explained, chains, refusal)
        assert refusal is None or refusal[0] is Reason.SLACK


def test_a_lone_object_that_one_chain_proposed_must_leave_something_of_the_views() -> None:
    seen = candidate().verification
    for chains, share, accepted in (
        (("objects",), 0.9, False),
        (("objects", "odometry"), 0.9, False),
        (("objects",), 1.1, True),
        (("features", "objects"), 0.9, True),
    ):
        around = replace(seen, tested=round(share * PARAMS.min_surroundings * seen.tested))
        lone = candidate(
            explained=(CUP,), margin=1.0, resistance=1.0, agreeing_chains=chains, surroundings=around, yaw_known=True
        )
        refusal = refuse(lone, PARAMS)
        assert (refusal is None) is accepted, (chains, share, refusal)
        assert refusal is None or (refusal[0] is Reason.LOW_OVERLAP and "without the cup" in refusal[1])


def test_several_objects_that_look_otherwise_may_not_float_either() -> None:
    far = {"floating": 0.5 * (PARAMS.max_floating_alone + PARAMS.max_floating)}
    assert refuse(candidate(**far, likeness=0.0), PARAMS) is None
    refusal = refuse(candidate(**far, likeness=PARAMS.min_likeness_unrivalled - 0.1), PARAMS)
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE


def test_two_objects_may_both_have_moved_but_three_stand_where_they_stood() -> None:
    far, three = {"floating": 1.1 * PARAMS.max_floating}, tuple(ObjectPair(k, k, "cup") for k in range(3))
    refusal = refuse(candidate(**far), PARAMS)
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
    assert refuse(candidate(**far, explained=three), PARAMS) is None


def test_where_something_floats_the_fall_over_a_push_makes_up_for_a_low_score() -> None:
    floating = 1.5 * PARAMS.max_violations_doubtful
    little = {"score": 0.5 * (PARAMS.min_score + PARAMS.min_score_doubtful), "margin": 1.0, "violations": floating}
    lacking = PARAMS.firm_margin - (little["score"] - PARAMS.min_score)
    for explained, resistance, accepted in (
        ((CUP,), 0.9 * lacking, False),
        ((CUP,), 1.1 * lacking, True),
        ((CUP,), None, True),
        ((CUP, ObjectPair(1, 1, "book")), 0.9 * lacking, False),
    ):
        refusal = refuse(candidate(explained=explained, resistance=resistance, **little), PARAMS)
        assert (refusal is None) is accepted, (explained, resistance, refusal)


def test_a_pose_that_views_like_well_need_not_resist_though_something_floats() -> None:
    floating = {"violations": 1.5 * PARAMS.max_violations_doubtful, "explained": (CUP, ObjectPair(1, 1, "book"))}
    liked = candidate(score=1.1 * PARAMS.min_score_doubtful, resistance=1.1 * PARAMS.rival_margin, **floating)
    assert refuse(liked, PARAMS) is None


def test_a_lone_object_that_views_like_little_need_not_resist_a_push_where_next_to_nothing_floats() -> None:
    little = {"score": 0.5 * (PARAMS.min_score + PARAMS.min_score_doubtful), "margin": 1.0, "explained": (CUP,)}
    soft = candidate(resistance=0.9 * PARAMS.firm_margin, violations=0.5 * PARAMS.max_violations_doubtful, **little)
    assert refuse(soft, PARAMS) is None


def test_a_lone_object_that_views_like_little_needs_two_chains() -> None:
    little = {"score": 0.5 * (PARAMS.min_score + PARAMS.min_score_doubtful), "margin": 1.0, "explained": (CUP,)}
    for chains in (("objects",), ("centroids", "objects")):  # the objects' poses are looked for from their middles too
        refusal = refuse(candidate(agreeing_chains=chains, **little), PARAMS)
        assert refusal is not None and refusal[0] is Reason.LOW_OVERLAP
    assert refuse(candidate(agreeing_chains=("features", "objects"), **little), PARAMS) is None


def test_a_lone_object_of_one_chain_is_refused_where_views_like_too_little_however_alike_it_looks() -> None:
    firm = {"resistance": PARAMS.min_firmness_alone, "agreeing_chains": ("objects",), "explained": (CUP,)}
    for score, accepted in ((1.1, True), (0.9, False)):
        alike = candidate(score=score * PARAMS.min_score, likeness=1.0, margin=1.0, **firm)
        refusal = refuse(alike, PARAMS)
        assert (refusal is None) is accepted, (score, refusal)
        assert refusal is None or refusal[0] is Reason.LOW_OVERLAP


def test_a_lone_object_of_one_chain_that_views_like_little_must_resist_a_push() -> None:
    score = 0.5 * (PARAMS.min_score + PARAMS.min_score_doubtful)
    for resistance, accepted in ((PARAMS.min_firmness_alone, True), (0.0, False), (None, False)):
        little = {"score": score, "likeness": 0.0, "margin": 1.0, "explained": (CUP,), "agreeing_chains": ("objects",)}
        refusal = refuse(candidate(resistance=resistance, **little), PARAMS)
        assert (refusal is None) is accepted, (resistance, refusal)


def test_a_lone_object_of_one_chain_needs_views_that_like_it_and_every_push_of_it_less() -> None:
    liked = {"score": 1.2 * PARAMS.min_score_doubtful, "margin": 1.0, "explained": (CUP,), "likeness": 0.9}
    lacking = PARAMS.min_firmness_alone - liked["score"]
    for chains, resistance, accepted in (
        (("objects",), 0.9 * lacking, False),
        (("centroids", "objects"), 0.9 * lacking, False),
        (("objects", "odometry"), 0.9 * lacking, False),
        (("objects",), 1.1 * lacking, True),
        (("objects",), None, True),
        (("features", "objects"), 0.9 * lacking, True),
    ):
        refusal = refuse(candidate(agreeing_chains=chains, resistance=resistance, **liked), PARAMS)
        assert (refusal is None) is accepted, (chains, resistance, refusal)
        assert refusal is None or refusal[0] is Reason.CHAINS_DISAGREE


def test_a_lone_object_that_tells_its_yaw_makes_up_for_a_push_that_is_resisted_less() -> None:
    liked = {"score": 1.2 * PARAMS.min_score_doubtful, "margin": 1.0, "explained": (CUP,), "likeness": 0.9}
    lacking = PARAMS.min_firmness_alone - liked["score"]
    for yaw_known, resistance, accepted in (
        (True, lacking - 0.9 * PARAMS.object_bonus, True),
        (True, lacking - 1.1 * PARAMS.object_bonus, False),
        (False, lacking - 0.9 * PARAMS.object_bonus, False),
    ):
        telling = candidate(agreeing_chains=("objects",), resistance=resistance, yaw_known=yaw_known, **liked)
        assert (refuse(telling, PARAMS) is None) is accepted, (yaw_known, resistance)


def test_an_object_that_looks_alike_makes_up_for_views_that_like_little() -> None:
    little = {"score": 0.2, "violations": 1.5 * PARAMS.max_violations_doubtful, "yaw_known": True, "margin": 1.0}
    little["resistance"] = 0.3 * PARAMS.firm_margin
    alike, otherwise = (candidate(explained=(CUP,), likeness=likeness, **little) for likeness in (1.0, 0.2))
    assert refuse(alike, PARAMS) is None
    refusal = refuse(otherwise, PARAMS)
    assert refusal is not None and refusal[0] is Reason.LOW_OVERLAP


def test_an_object_that_looks_otherwise_takes_nothing_from_what_views_like() -> None:
    assert refuse(candidate(score=1.1 * PARAMS.min_score, likeness=-1.0), PARAMS) is None


def test_a_plain_table_needs_no_print_where_several_objects_stand_where_they_should() -> None:
    several = tuple(ObjectPair(k, k, "cup") for k in range(PARAMS.min_objects_plain))
    plain = {"texture": 0.5 * PARAMS.min_texture}
    assert refuse(candidate(explained=several, **plain), PARAMS) is None
    for evidence in ({"explained": several[:-1], **plain}, {"explained": several, "texture": -0.1}):
        refusal = refuse(candidate(**evidence), PARAMS)
        assert refusal is not None and refusal[0] is Reason.TEXTURE


def test_two_objects_make_up_for_a_chain_that_is_alone() -> None:
    assert refuse(candidate(agreeing_chains=("features",)), PARAMS) is None


def test_a_moved_object_is_outvoted_by_those_that_stayed() -> None:
    assert refuse(candidate(moved=(ObjectPair(2, 2, "bottle"),)), PARAMS) is None


def _prior(x: float, trusted: bool = True) -> Prior:
    return Prior(T_target_source=moved(x), rotation_deg=1.0, translation_m=0.05, trusted=trusted)


def test_a_pose_far_from_odometry_is_refused_unless_it_is_our_own_tracking() -> None:
    assert refuse(candidate(), PARAMS, _prior(0.05)) is None
    assert refuse(candidate(), PARAMS, _prior(1.0, trusted=False)) is None
    refusal = refuse(candidate(), PARAMS, _prior(1.0))
    assert refusal is not None and refusal[0] is Reason.ODOMETRY


@pytest.mark.parametrize(("beyond", "accepted"), [(0.9, True), (1.1, False)])
def test_odometry_refuses_a_turn_as_well_as_a_shift_beyond_its_sigmas(beyond: float, accepted: bool) -> None:
    sigmas = beyond * PARAMS.odometry_sigmas
    turned = pose(rotation_from_vector(np.radians([0.0, sigmas * 1.0, 0.0])), np.zeros(3))
    for prior in (_prior(sigmas * 0.05), replace(_prior(0.0), T_target_source=turned)):
        refusal = refuse(candidate(), PARAMS, prior)
        assert (refusal is None) is accepted and (accepted or refusal[0] is Reason.ODOMETRY)


def test_the_second_candidate_is_taken_when_the_first_is_refused() -> None:
    good = candidate()
    assert judge((candidate(violations=0.4), good), PARAMS) is good


def test_the_refusal_is_that_of_the_best_candidate() -> None:
    verdict = judge((candidate(violations=0.4), candidate(texture=-1.0)), PARAMS)
    assert isinstance(verdict, tuple) and verdict[0] is Reason.FREE_SPACE


def test_the_best_candidate_is_the_first_whatever_views_like_more() -> None:
    good = candidate(score=0.6)
    assert judge((candidate(violations=0.4, score=0.6), good, candidate(violations=0.4, score=0.9)), PARAMS) is good


def test_no_candidate_at_all_is_no_hypothesis() -> None:
    verdict = judge((), PARAMS)
    assert isinstance(verdict, tuple) and verdict[0] is Reason.NO_HYPOTHESIS


def test_an_alias_does_not_stand_in_for_a_refused_best_candidate() -> None:
    alias = candidate(score=0.5)
    assert judge((candidate(violations=0.4, score=0.9), alias), PARAMS) is not alias


def lone(**evidence: object) -> Candidate:
    """A candidate of one object that no second chain confirms, in a plain room."""
    alone = {"explained": (ObjectPair(0, 0, "cup"),), "agreeing_chains": ("objects",), "texture": 0.4}
    return candidate(**{**alone, "likeness": 0.6, "yaw_known": True, "margin": 0.4, **evidence})


def rival(one: Candidate, behind: float, **evidence: object) -> Candidate:
    """Another pose of the same object, worth so much less."""
    return lone(score=one.verification.score - behind, likeness=one.likeness, **evidence)


def test_a_lone_object_that_is_unmistakable_needs_no_second_chain() -> None:
    assert refuse(lone(), PARAMS) is None


def test_a_lone_object_whose_pose_has_a_rival_is_refused_whichever_chains_agree() -> None:
    for chains in (("objects",), ("features", "objects")):
        one = lone(agreeing_chains=chains)
        refusal = refuse(one, PARAMS, rivals=[rival(one, 0.05)])
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_several_objects_whose_pose_has_a_rival_that_is_worth_as_much_are_refused() -> None:
    several = candidate()
    assert len(several.explained) >= PARAMS.min_objects
    score = several.verification.score
    near, far = (candidate(score=score - share * PARAMS.rival_margin) for share in (0.9, 1.1))
    assert refuse(several, PARAMS, rivals=[several, far]) is None
    refusal = refuse(several, PARAMS, rivals=[several, near])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE and "2 objects" in refusal[1]
    impossible = replace(near, gravity_error_deg=2.0 * PARAMS.max_gravity_error)
    assert judge([several, impossible], PARAMS) is several


def test_a_rival_that_hides_more_is_the_rival_that_it_were_if_all_of_that_agreed() -> None:
    one = lone()
    assert refuse(one, PARAMS, rivals=[rival(one, 0.6)]) is None
    refusal = refuse(one, PARAMS, rivals=[rival(one, 0.6, occluded=0.5)])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


@pytest.mark.parametrize(
    "against", [{"violations": 0.4}, {"floating": 0.3}, {"explained": ()}, {"gravity_error_deg": 30.0}], ids=str
)
def test_a_pose_that_cannot_be_true_is_no_rival(against: dict) -> None:
    one = lone()
    assert isinstance(judge((one, rival(one, 0.05)), PARAMS), tuple)
    assert judge((one, rival(one, 0.05, **against)), PARAMS) is one


@pytest.mark.parametrize("doubt", [{"yaw_known": False}, {"likeness": -0.1}, {"likeness": None}], ids=str)
def test_chains_that_agree_in_a_plain_room_do_not_speak_for_an_object_that_could_be_another(doubt: dict) -> None:
    doubted = lone(**doubt, margin=0.1, agreeing_chains=("features", "objects"))
    refusal = refuse(doubted, PARAMS, rivals=[rival(doubted, 0.1)])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE
    assert refuse(lone(**{**doubt, "texture": 0.6, "margin": 0.6}), PARAMS) is None


def test_an_object_that_looks_otherwise_is_another_however_good_its_pose() -> None:
    refusal = refuse(lone(likeness=PARAMS.min_likeness_unrivalled - 0.1, margin=3.0), PARAMS)
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_without_grey_a_lone_object_has_to_tell_its_yaw_and_look_alike() -> None:
    assert refuse(lone(texture=None), PARAMS) is None
    for doubt in ({"yaw_known": False}, {"likeness": -0.1}):
        refusal = refuse(lone(texture=None, **doubt), PARAMS)
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def warped(sigma: float) -> dict[str, object]:
    """The evidence of a position that a warped depth leaves as badly known as that."""
    return {"warp": np.diag([sigma**2, 0, 0, 0, 0, 0])}


def test_a_pose_that_a_warped_depth_would_move_far_is_refused_as_sliding() -> None:
    kept, refused = (refuse(candidate(**warped(PARAMS.max_slack_sigma * share)), PARAMS) for share in (0.9, 1.1))
    assert kept is None
    assert refused is not None and refused[0] is Reason.SLACK


def test_the_worse_the_surfaces_hold_a_pose_the_more_the_views_must() -> None:
    loose, least = warped(1.5 * PARAMS.max_slack_sigma), 2.25 * PARAMS.rival_margin
    assert refuse(candidate(**loose, resistance=least + 0.01), PARAMS) is None
    assert refuse(candidate(**loose, resistance=least - 0.01), PARAMS) is not None


@pytest.mark.parametrize("eye", [0.0, 0.4])
def test_the_farther_away_what_is_seen_the_more_the_views_must_hold_it(eye: float) -> None:
    """Far from both cameras in the mean: the other one stands ``eye`` nearer."""
    for share, least in ((0.9, 1.0), (1.0, 1.0), (1.4, 1.96)):
        middle = np.array([0.0, 0.0, share * PARAMS.far_range + eye / 2.0])
        seen = {"T": moved(0.0, 0.0, eye), "middle": middle}
        assert refuse(candidate(**seen, resistance=1.01 * least * PARAMS.rival_margin), PARAMS) is None
        refusal = refuse(candidate(**seen, resistance=0.99 * least * PARAMS.rival_margin), PARAMS)
        assert refusal is not None and refusal[0] is Reason.SLACK
    assert refuse(candidate(middle=np.array([0.0, 0.0, 1.4 * PARAMS.far_range])), PARAMS) is None  # not pushed


def test_of_distance_and_what_surfaces_know_the_worse_counts() -> None:
    far = {"middle": np.array([0.0, 0.0, 1.2 * PARAMS.far_range]), **warped(1.5 * PARAMS.max_slack_sigma)}
    assert refuse(candidate(**far, resistance=2.3 * PARAMS.rival_margin), PARAMS) is None
    assert refuse(candidate(**far, resistance=2.2 * PARAMS.rival_margin), PARAMS) is not None
    far["middle"] = np.array([0.0, 0.0, 1.6 * PARAMS.far_range])
    assert refuse(candidate(**far, resistance=2.5 * PARAMS.rival_margin), PARAMS) is not None


def test_several_objects_that_look_otherwise_leave_more_to_the_views() -> None:
    least = PARAMS.rival_margin
    several = {"explained": (ObjectPair(0, 0, "cup"), ObjectPair(1, 1, "book")), "resistance": 1.2 * least}
    assert refuse(candidate(**several, likeness=0.1), PARAMS) is None
    refusal = refuse(candidate(**several, likeness=-0.1), PARAMS)
    assert refusal is not None and refusal[0] is Reason.SLACK
    assert refuse(candidate(**{**several, "resistance": 2.0 * least}, likeness=-0.1), PARAMS) is None


def test_several_objects_may_be_what_they_are_a_little_aside_and_a_lone_one_may_not() -> None:
    aside = {"likeness": -1.0, "resistance": 1.2 * PARAMS.rival_margin}
    assert refuse(candidate(**aside, likeness_nearby=0.1), PARAMS) is None
    assert refuse(candidate(**aside), PARAMS) is not None
    assert refuse(lone(likeness=-1.0, likeness_nearby=0.1), PARAMS) is not None


def test_a_pose_that_the_views_hold_firmly_is_known_however_badly_the_surfaces_know_it() -> None:
    badly, firm = warped(10.0 * PARAMS.max_slack_sigma), PARAMS.firm_margin
    assert refuse(candidate(**badly, resistance=firm + 0.01), PARAMS) is None
    refusal = refuse(candidate(**badly, resistance=firm - 0.01), PARAMS)
    assert refusal is not None and refusal[0] is Reason.SLACK


@pytest.mark.parametrize("direction", [0, 5])
def test_a_direction_that_nothing_holds_is_refused_however_firmly_the_rest_is_held(direction: int) -> None:
    firm = {"resistance": 2.0 * PARAMS.firm_margin, "score": 1.0}
    assert refuse(candidate(**firm), PARAMS) is None
    refusal = refuse(candidate(**firm, slack=np.eye(6)[direction : direction + 1]), PARAMS)
    assert refusal is not None and refusal[0] is Reason.SLACK
    assert "1 of 6" in refusal[1]
