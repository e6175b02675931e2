# SPDX-License-Identifier: Apache-2.0
"""Competing hypotheses that score as much."""

from __future__ import annotations

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate import competing
from objreg_ros.registration.gate.verdict import judge, refuse
from registration.gate.samples import competitor, lone
from registration.samples import candidate


def test_a_refusal_says_how_near_the_other_pose_comes() -> None:
    assert competing.check(0.1, 0.1) is None
    assert competing.check(0.05, 0.1) == (
        Reason.PROPOSERS_DISAGREE,
        "another possible pose scores 0.05 < 0.10 lower",
    )


def test_a_likely_pose_is_refused_where_another_one_scores_as_much() -> None:
    refusal = refuse(candidate(score_margin=competing.LEAST_MARGIN - 0.01))
    assert refusal is not None and refusal[0] is Reason.PROPOSERS_DISAGREE


@pytest.mark.parametrize("behind", [0.0, 0.05])
def test_of_two_poses_that_score_the_same_none_is_accepted(behind: float) -> None:
    one = lone()
    verdict = judge((one, competitor(one, behind)))
    assert isinstance(verdict, tuple) and verdict[0] is Reason.PROPOSERS_DISAGREE
