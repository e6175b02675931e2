# SPDX-License-Identifier: Apache-2.0
"""Competing hypotheses."""

from __future__ import annotations

from dataclasses import replace

from objreg_ros.data import Reason
from objreg_ros.registration.gate import competing, gravity
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import judge, refuse
from registration.gate.samples import competitor, lone
from registration.samples import candidate

LIMITS = competing.Limits(objects=2, several_margin=0.1, lone_margin=0.2)


def test_several_objects_are_asked_for_a_margin_only() -> None:
    assert competing.check_several(2, 0.1, LIMITS) is None and competing.check_several(1, 0.0, LIMITS) is None
    told = "2 objects, another possible pose is worth 0.05 < 0.10 less"
    assert competing.check_several(2, 0.05, LIMITS) == (Reason.CHAINS_DISAGREE, told)


def test_a_lone_object_is_asked_for_a_margin_and_for_confirmation() -> None:
    assert competing.check_lone(1, 0.2, True, 1, None, LIMITS) is None
    assert competing.check_lone(2, 0.0, False, 1, None, LIMITS) is None
    for score_margin, confirmed in ((0.2, False), (0.19, True)):
        refusal = competing.check_lone(1, score_margin, confirmed, 3, 0.4, LIMITS)
        assert refusal == (
            Reason.CHAINS_DISAGREE,
            f"1 objects < 2, 3 chains, likeness 0.40, margin {score_margin:.2f}",
        )


def test_a_lone_object_whose_pose_has_a_competitor_is_refused_whichever_proposers_agree() -> None:
    for proposers in (("objects",), ("features", "objects")):
        one = lone(agreeing_proposers=proposers)
        refusal = refuse(one, possible=[competitor(one, 0.05)])
        assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE


def test_several_objects_whose_pose_has_a_competitor_that_is_worth_as_much_are_refused() -> None:
    several = candidate()
    assert len(several.matched) >= GATE.competing.objects
    score = several.verification.score
    near, far = (candidate(score=score - share * GATE.competing.several_margin) for share in (0.9, 1.1))
    assert refuse(several, possible=[several, far]) is None
    refusal = refuse(several, possible=[several, near])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE and "2 objects" in refusal[1]
    impossible = replace(near, gravity_error_sigmas=2.0 * gravity.SIGMAS)
    assert judge([several, impossible]) is several


def test_a_competitor_that_hides_more_is_the_competitor_that_it_were_if_all_of_that_agreed() -> None:
    one = lone()
    assert refuse(one, possible=[competitor(one, 0.6)]) is None
    refusal = refuse(one, possible=[competitor(one, 0.6, occluded=0.5)])
    assert refusal is not None and refusal[0] is Reason.CHAINS_DISAGREE
