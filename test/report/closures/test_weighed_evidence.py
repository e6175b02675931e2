# SPDX-License-Identifier: Apache-2.0
"""Each bar is a term of the odds, and they add up to their logarithm."""

from __future__ import annotations

from math import log10

import pytest

from objreg_ros.registration.gate.kinds import KINDS
from objreg_ros.registration.gate.likelihood import BEFORE, log_odds, terms
from objreg_tools.report.closures.weighed_evidence import EVIDENCE, weighed

READINGS = {
    "tested": 10438.0,
    "certain_violations": 0.0,
    "correlation": 0.884,
    "matched": 5.0,
    "proposers": 2.0,
    "score_margin": -0.4,
    "position_sigma": 0.0111,
    "scaled_sigma": 0.0151,
    "rmse": 0.025,
    "range": 2.57,
}
PUBLISHED = {"odds": 10.0 ** log_odds(READINGS), **READINGS, "score": 0.882}


def test_the_bars_add_up_to_the_logarithm_of_the_published_odds() -> None:
    of = weighed(PUBLISHED)
    assert of.total == pytest.approx(log10(PUBLISHED["odds"]), abs=1e-9)
    assert sum(row.weight for row in of.readings if row.weight is not None) == pytest.approx(of.total)
    assert [row.key for row in of.readings if row.weight is not None] == [BEFORE, *KINDS]


def test_each_bar_is_the_weight_of_its_kind_for_or_against() -> None:
    weights = {row.key: row.weight for row in weighed(PUBLISHED).readings}
    assert weights["correlation"] == 0.515 and weights["score_margin"] == -0.532 and weights["rmse"] == -0.461
    assert weights["silhouettes"] == -0.194, "what is not known has a weight, too"
    assert weights["score"] is None
    assert weights == {**terms(READINGS), "odds": None, "score": None}


def test_names_with_spaces_are_the_same_and_numbers_have_units() -> None:
    spaced = {name.replace("_", " "): value for name, value in PUBLISHED.items()}
    assert weighed(spaced) == weighed(PUBLISHED)
    values = {row.key: row.value for row in weighed(PUBLISHED).readings}
    assert (values["tested"], values["rmse"], values["position_sigma"]) == ("10,438", "25 mm", "1.11 cm")
    assert values["silhouettes"] == "not known" and values[BEFORE] == ""


def test_odds_by_other_weights_have_no_bars() -> None:
    of = weighed({**PUBLISHED, "odds": 2.0 * PUBLISHED["odds"]})
    assert of.total is None and all(row.weight is None for row in of.readings)
    assert weighed({}).readings == () and weighed({"odds": -2.0}).total is None


def test_what_has_no_name_in_plain_words_keeps_its_own() -> None:
    (row,) = weighed({"moved cup [m]": 0.4}).readings
    assert (row.key, row.value) == ("moved cup [m]", "0.4")


def test_the_least_odds_are_those_of_the_run() -> None:
    assert weighed(PUBLISHED, 100.0).least == pytest.approx(2.0)


def test_every_kind_that_is_weighed_has_a_name_in_plain_words() -> None:
    assert EVIDENCE.keys() >= {BEFORE, *KINDS}
