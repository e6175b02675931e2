# SPDX-License-Identifier: Apache-2.0
"""Which state it is, by known numbers."""

from __future__ import annotations

import math

import pytest

from objreg_ros.data.localisation import State
from objreg_ros.registrar.localisation.verdict import Standing, reason_of, state_of, within

NAN = math.nan


def standing(**values: object) -> Standing:
    return Standing(elsewhere=1e-4, sigma_m=0.1, age_s=3.0, missing=0, contradicting=0)._replace(**values)


def test_the_probability_of_a_ball_is_that_of_three_normal_numbers() -> None:
    assert within(0.5, 0.5) == pytest.approx(0.1987, abs=1e-4)  # chi-square of three, at 1
    assert within(0.5, 0.2) == pytest.approx(0.8999, abs=1e-4)  # at 6.25
    assert within(0.5, 0.0) == 1.0 and math.isnan(within(0.5, NAN))


def test_without_a_map_it_is_tracking_and_with_one_sure_until_it_has_drifted() -> None:
    assert state_of(standing(sigma_m=NAN)) is State.TRACKING
    assert state_of(standing()) is State.SURE
    assert state_of(standing(sigma_m=0.25)) is State.UNSURE
    assert state_of(standing(elsewhere=0.2)) is State.UNSURE


def test_it_is_lost_where_it_is_more_likely_elsewhere_with_a_map_or_without() -> None:
    assert state_of(standing(elsewhere=0.6)) is State.LOST
    assert state_of(standing(elsewhere=0.6, sigma_m=NAN)) is State.LOST


def test_kidnapped_comes_first() -> None:
    now = standing(elsewhere=0.9, kidnapped="2 closures that agree")
    assert state_of(now) is State.KIDNAPPED and reason_of(now) == "2 closures that agree"


def test_places_that_fit_alike_leave_it_ambiguous_unless_it_is_elsewhere() -> None:
    alike = standing(alike="0 keyframes speak for one place, 0 for the other")
    assert state_of(alike) is State.AMBIGUOUS and state_of(alike._replace(sigma_m=math.nan)) is State.AMBIGUOUS
    assert state_of(alike._replace(elsewhere=0.9)) is State.LOST
    assert reason_of(alike) == "two places of a map fit alike: " + alike.alike + ", the last closure 3.0 s ago"


def test_the_reason_has_the_numbers() -> None:
    assert "0.99" in reason_of(standing(sigma_m=0.15)) and "3.0 s ago" in reason_of(standing())
    assert "4 known objects are missing" in reason_of(standing(elsewhere=0.8, missing=4))
    assert "ago" not in reason_of(standing(age_s=NAN, sigma_m=NAN))
