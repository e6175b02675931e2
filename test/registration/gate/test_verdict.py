# SPDX-License-Identifier: Apache-2.0
"""The verdict: which candidate is accepted, and whose refusal is given."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.closures import Alignment, Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.likelihood import odds_of
from objreg_ros.registration.gate.limits import LIMITS
from objreg_ros.registration.gate.verdict import check_rules, compared, judge, refuse
from registration.gate.samples import CUP, competitor, lone
from registration.samples import candidate, moved

TILTED = {"gravity_error_deg": 30.0, "gravity_error_sigmas": 30.0}


def test_a_candidate_that_nothing_speaks_against_is_accepted() -> None:
    assert refuse(candidate()) is None


@pytest.mark.parametrize(
    ("evidence", "reason"),
    [
        ({"converged": False}, Reason.NOT_CONVERGED),
        ({"T": moved(100.0)}, Reason.IMPLAUSIBLE_MOTION),
        ({"gravity_error_deg": 30.0, "gravity_error_sigmas": 30.0}, Reason.GRAVITY),
        ({"certain_violations": 0.2}, Reason.FREE_SPACE),
        ({"matched": (), "moved": (CUP,)}, Reason.MOVED),
        ({"matched": ()}, Reason.FEW_OBJECTS),
        ({"degenerate": np.eye(6)[:1]}, Reason.SLACK),
        ({"correlation": -0.2, "tested": 100, "perturbation_margin": 0.0}, Reason.TEXTURE),
        ({"information": np.diag([1.0, 1e5, 1e5, 1e5, 1e5, 1e5]), "perturbation_margin": 0.0}, Reason.SLACK),
    ],
)
def test_a_broken_rule_and_small_odds_refuse_with_their_numbers(evidence: dict[str, object], reason: Reason) -> None:
    refusal = refuse(candidate(**evidence))
    assert refusal is not None and refusal[0] is reason
    assert any(letter.isdigit() for letter in refusal[1])


def test_what_refuses_by_its_odds_breaks_no_rule() -> None:
    unlikely = candidate(correlation=-0.2, tested=100, perturbation_margin=0.0)
    assert check_rules(unlikely) is None and refuse(unlikely) is not None


def test_a_candidate_without_grey_or_gravity_is_judged_by_the_rest() -> None:
    assert refuse(candidate(correlation=None, gravity_error_deg=None)) is None


def test_a_user_s_least_odds_decide() -> None:
    one = candidate()
    found = odds_of(one)
    assert refuse(one, limits=LIMITS._replace(odds=0.99 * found)) is None
    assert refuse(one, limits=LIMITS._replace(odds=1.01 * found)) is not None


def chosen(candidates: tuple[Candidate, ...]) -> Alignment | None:
    """The alignment that is accepted, None if none is."""
    verdict = judge(candidates)
    return verdict.alignment if isinstance(verdict, Candidate) else None


def test_the_second_candidate_is_taken_when_the_first_is_refused() -> None:
    good = candidate()
    assert chosen((candidate(**TILTED), good)) is good.alignment


def test_the_refusal_is_that_of_the_best_candidate() -> None:
    verdict = judge((candidate(violations=0.4), candidate(correlation=-1.0)))
    assert isinstance(verdict, tuple) and verdict[0] is Reason.FREE_SPACE


def test_the_best_candidate_is_the_first_whatever_views_like_more() -> None:
    good = candidate(score=0.6)
    rest = candidate(**TILTED, score=0.6), candidate(**TILTED, score=0.9)
    assert chosen((rest[0], good, rest[1])) is good.alignment


def test_no_candidate_at_all_is_no_hypothesis() -> None:
    verdict = judge(())
    assert isinstance(verdict, tuple) and verdict[0] is Reason.NO_HYPOTHESIS


def test_an_alias_does_not_stand_in_for_a_refused_best_candidate() -> None:
    alias = candidate(score=0.5)
    assert chosen((candidate(violations=0.4, score=0.9), alias)) is None


def test_a_pose_that_does_not_keep_gravity_is_no_rival() -> None:
    one = lone()
    alone, beside = compared((one, competitor(one, 0.05)))[0], compared((one, competitor(one, 0.05, **TILTED)))[0]
    assert alone.score_margin == pytest.approx(0.05)
    assert beside.score_margin == compared((one,))[0].score_margin > 1.0


def test_a_rival_makes_a_pose_less_likely() -> None:
    one = lone()
    alone, rivalled = compared((one,))[0], compared((one, competitor(one, 0.05)))[0]
    assert odds_of(rivalled) < 0.5 * odds_of(alone)
