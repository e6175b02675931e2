# SPDX-License-Identifier: Apache-2.0
"""How likely a pose is right: the sum of what each kind of evidence weighs."""

from __future__ import annotations

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate import likelihood
from objreg_ros.registration.gate.kinds import KINDS, readings_of
from objreg_ros.registration.gate.likelihood import BEFORE, check, log_odds, odds_of, terms, weigh
from registration.gate.samples import CUP
from registration.samples import candidate

RATIOS = {"certain_violations": (1.0, 0.5, 0.0, 0.0, 0.0, -3.0), "correlation": (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)}


@pytest.fixture(autouse=True)
def known_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two kinds of evidence speak, the others say nothing."""
    nothing = {name: (0.0,) * len(kind.knots) for name, kind in KINDS.items()}
    monkeypatch.setattr(likelihood, "PRIOR", 0.5)
    monkeypatch.setattr(likelihood, "WEIGHTS", nothing | RATIOS)
    monkeypatch.setattr(likelihood, "UNKNOWN", dict.fromkeys(KINDS, 0.0) | {"correlation": -0.25})


@pytest.mark.parametrize(("violations", "weight"), [(0.0, 1.0), (0.0005, 0.75), (0.001, 0.5), (0.5, -3.0), (-1.0, 1.0)])
def test_a_weight_is_linear_between_knots_and_constant_beyond(violations: float, weight: float) -> None:
    assert weigh("certain_violations", violations) == pytest.approx(weight)


def test_what_is_unknown_has_a_weight_of_its_own() -> None:
    assert weigh("correlation", None) == -0.25


def test_weights_add_up_to_the_logarithm_of_the_odds() -> None:
    one = candidate(certain_violations=0.001, correlation=0.65)
    assert log_odds(readings_of(one)) == pytest.approx(0.5 + 0.5 + 1.0)
    assert odds_of(one) == pytest.approx(100.0)


def test_the_terms_are_the_prior_and_the_weight_of_each_kind() -> None:
    readings = readings_of(candidate(matched=(CUP,)))
    of = terms(readings)
    assert list(of) == [BEFORE, *KINDS] and sum(of.values()) == pytest.approx(log_odds(readings))
    assert all(of[name] == weigh(name, reading) for name, reading in readings.items())


def test_a_pose_is_refused_below_the_least_odds_for_what_it_lacks_most() -> None:
    one = candidate(certain_violations=0.025, correlation=0.65)
    assert check(one, 0.01) is None
    refusal = check(one, 100.0)
    assert refusal is not None
    reason, detail = refusal
    assert reason is Reason.FREE_SPACE
    assert detail == "odds 0.032 < 100, most for certain violations 0.025"


def test_a_refusal_says_that_what_it_lacks_is_unknown() -> None:
    refusal = check(candidate(certain_violations=0.0, correlation=None, matched=(CUP,)), 1e6)
    assert refusal is not None and refusal == (Reason.TEXTURE, "odds 18 < 1e+06, most for correlation of grey unknown")


def test_a_kind_that_no_fit_has_seen_weighs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    one = candidate()
    before = log_odds(readings_of(one))
    monkeypatch.setitem(KINDS, "new", KINDS["rmse"])
    assert log_odds(readings_of(one)) == before and check(candidate(tested=10, correlation=-0.5), 1e6) is not None
