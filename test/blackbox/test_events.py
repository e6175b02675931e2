# SPDX-License-Identifier: Apache-2.0
"""Which decision makes a file."""

from __future__ import annotations

import pytest

from objreg_ros.blackbox.events import LOST, WEAK, Event, Rest, of_closure, of_refusal, of_state


def test_a_refusal_of_a_chosen_kind_is_an_event_and_another_is_none() -> None:
    event = of_refusal("odometry_disagrees", "by 3 m", 1, 2, ("odometry_disagrees",))
    assert event == Event("odometry_disagrees", "by 3 m", 1, 2)
    assert of_refusal("redundant", "", 1, 2, ("odometry_disagrees",)) is None


@pytest.mark.parametrize(("evidence", "found"), [({"odds": 99.0}, True), ({"odds": 100.0}, False), ({}, False)])
def test_a_closure_with_weak_odds_is_an_event(evidence: dict[str, float], found: bool) -> None:
    event = of_closure(1, 2, evidence, least_odds=100.0)
    assert (event is not None and event.what == WEAK) == found


def test_a_state_is_an_event_as_it_becomes_lost_and_not_while_it_is() -> None:
    event = of_state("LOST", "SURE", "nothing fits")
    assert event is not None and (event.what, event.detail) == (LOST, "LOST: nothing fits")
    assert of_state("KIDNAPPED", "LOST") is None and of_state("SURE", "LOST") is None
    assert of_state("kidnapped", "") is not None


def test_one_event_passes_in_so_many_seconds_of_the_stream_and_anew_where_the_clock_goes_back() -> None:
    rest = Rest(10.0)
    stamps = (100, 105, 109.9, 110, 115, 30, 35, 40)
    assert [rest.passes(round(1e9 * stamp)) for stamp in stamps] == [True, False, False, True, False, True, False, True]
