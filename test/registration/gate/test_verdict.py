# SPDX-License-Identifier: Apache-2.0
"""The verdict: which candidate is accepted, and whose refusal is told."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.gate.verdict import judge, refuse
from registration.gate.samples import CUP, competitor, lone
from registration.samples import candidate, moved


def test_a_candidate_that_nothing_speaks_against_is_accepted() -> None:
    assert refuse(candidate()) is None


@pytest.mark.parametrize(
    ("evidence", "reason"),
    [
        ({"converged": False}, Reason.NOT_CONVERGED),
        ({"T": moved(100.0)}, Reason.IMPLAUSIBLE_MOTION),
        ({"gravity_error_deg": 30.0, "gravity_error_sigmas": 30.0}, Reason.GRAVITY),
        ({"tested": 20}, Reason.LOW_OVERLAP),
        ({"inliers": 0.1}, Reason.LOW_OVERLAP),
        ({"violations": 0.5}, Reason.FREE_SPACE),
        ({"texture": -0.2}, Reason.TEXTURE),
        ({"score": -1.0}, Reason.LOW_OVERLAP),
        ({"agreeing_proposers": ("objects",), "matched": (CUP,)}, Reason.CHAINS_DISAGREE),
        ({"agreeing_proposers": ("features",), "matched": ()}, Reason.FEW_OBJECTS),
        ({"agreeing_proposers": ("features",), "matched": (), "perturbation_margin": 0.1}, Reason.FEW_OBJECTS),
        ({"matched": (), "moved": (CUP,)}, Reason.MOVED),
        ({"information": np.diag([1.0, 1e5, 1e5, 1e5, 1e5, 1e5])}, Reason.SLACK),
        ({"degenerate": np.eye(6)[:1]}, Reason.SLACK),
        ({"perturbation_margin": 0.02}, Reason.SLACK),
    ],
)
def test_each_kind_of_evidence_alone_can_refuse(evidence: dict[str, object], reason: Reason) -> None:
    refusal = refuse(candidate(**evidence))
    assert refusal is not None and refusal[0] is reason
    assert any(letter.isdigit() for letter in refusal[1])


def test_a_candidate_without_grey_or_gravity_is_judged_by_the_rest() -> None:
    assert refuse(candidate(texture=None, gravity_error_deg=None)) is None


def test_two_objects_make_up_for_a_proposer_that_is_alone() -> None:
    assert refuse(candidate(agreeing_proposers=("features",))) is None


def test_the_second_candidate_is_taken_when_the_first_is_refused() -> None:
    good = candidate()
    assert judge((candidate(violations=0.4), good)) is good


def test_the_refusal_is_that_of_the_best_candidate() -> None:
    verdict = judge((candidate(violations=0.4), candidate(texture=-1.0)))
    assert isinstance(verdict, tuple) and verdict[0] is Reason.FREE_SPACE


def test_the_best_candidate_is_the_first_whatever_views_like_more() -> None:
    good = candidate(score=0.6)
    assert judge((candidate(violations=0.4, score=0.6), good, candidate(violations=0.4, score=0.9))) is good


def test_no_candidate_at_all_is_no_hypothesis() -> None:
    verdict = judge(())
    assert isinstance(verdict, tuple) and verdict[0] is Reason.NO_HYPOTHESIS


def test_an_alias_does_not_stand_in_for_a_refused_best_candidate() -> None:
    alias = candidate(score=0.5)
    assert judge((candidate(violations=0.4, score=0.9), alias)) is not alias


@pytest.mark.parametrize(
    "against",
    [{"violations": 0.4}, {"certain_violations": 0.3}, {"matched": ()}, {"gravity_error_sigmas": 30.0}],
    ids=str,
)
def test_a_pose_that_cannot_be_true_is_no_rival(against: dict) -> None:
    one = lone()
    assert isinstance(judge((one, competitor(one, 0.05))), tuple)
    assert judge((one, competitor(one, 0.05, **against))) is one
