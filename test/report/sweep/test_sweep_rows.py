# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_tools.report.sweep.sweep_rows import (
    best_of,
    equals_of,
    front_of,
    is_judged,
    most_false,
    ranked,
    shown,
)

from .samples import BLIND, HIGH, LOW, SAME, USUAL, found


def test_a_false_constraint_weighs_more_than_any_revisit() -> None:
    assert best_of([LOW, HIGH]) is HIGH and ranked([LOW, HIGH, USUAL]) == [USUAL, HIGH, LOW]


def test_of_equals_the_nearest_to_the_defaults_is_the_best() -> None:
    assert best_of([SAME, USUAL, LOW]) is USUAL and equals_of([SAME, USUAL, LOW], USUAL) == 2


def test_without_truth_nothing_is_the_best() -> None:
    assert not is_judged(BLIND) and best_of(BLIND) is None and ranked(BLIND) == BLIND and BLIND[0].recall is None


def test_what_failed_on_a_recording_comes_last_and_is_never_the_best() -> None:
    failed = replace(USUAL, found=(*USUAL.found, found(error="gone")))
    assert ranked([failed, LOW]) == [LOW, failed] and best_of([failed]) is None


def test_counts_are_over_all_recordings_and_so_is_the_recall() -> None:
    both = replace(USUAL, found=(*USUAL.found, found(constraints=3, revisits=30, closed=1, odds=(500.0,))))
    assert both.total("constraints") == 12 and both.recall == pytest.approx(8 / 40)
    assert both.odds == [500.0, 300.0, 90.0]


def test_the_front_holds_what_no_other_beats() -> None:
    assert front_of([HIGH, LOW, USUAL]) == [USUAL, LOW]


def test_none_false_of_a_few_is_no_proof() -> None:
    assert most_false(0, 0) is None and most_false(3, 3) == 1.0
    assert most_false(0, 59) == pytest.approx(0.05, abs=1e-3)  # the rule of three, to the digit: 1 - 0.05 ** (1 / 59)
    assert most_false(1, 10) == pytest.approx(0.394, abs=1e-3)


def test_values_are_short_texts() -> None:
    assert [shown(value) for value in (75.0, 0.3, ("a", "b"), True, "x")] == ["75", "0.3", "a b", "True", "x"]
