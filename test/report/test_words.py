# SPDX-License-Identifier: Apache-2.0
"""Counts and comparisons say what the numbers say, in the singular and in the plural."""

from __future__ import annotations

import pytest

from objreg_tools.report.words import change, judgement, number_of, reading


def test_one_is_singular() -> None:
    assert [number_of(count, "loop") for count in (0, 1, 2)] == ["0 loops", "1 loop", "2 loops"]


def test_a_reading_has_three_digits_or_all_that_stand_before_the_point() -> None:
    said = [reading(value) for value in (None, 0.0, 0.03234, 210.4, 5980.0, -1234.5)]
    assert said == ["unknown", "0", "0.0323", "210", "5,980", "-1,234"]


@pytest.mark.parametrize(
    ("false", "judged", "count", "said"),
    [
        (0, 0, 1, "there is no truth to judge it by"),
        (0, 0, 3, "there is no truth to judge them by"),
        (0, 12, 12, "none of the 12 is false"),
        (0, 9, 12, "none of the 9 that truth can judge is false; 3 could not be judged"),
        (1, 12, 12, "1 of the 12 is false"),
        (2, 9, 12, "2 of the 9 that truth can judge are false; 3 could not be judged"),
        (0, 1, 1, "the only one is not false"),
        (1, 1, 1, "the only one is false"),
        (0, 1, 4, "the 1 that truth can judge is not false; 3 could not be judged"),
    ],
)
def test_only_what_truth_can_judge_is_called_right_or_false(false: int, judged: int, count: int, said: str) -> None:
    assert judgement(false, judged, count) == said


def test_a_trajectory_is_better_or_worse_or_neither() -> None:
    assert change(2.0, 1.0, "odometry") == "50 % better than odometry"
    assert change(1.0, 1.11, "odometry") == "11 % worse than odometry"
    assert change(1.0, 1.001, "odometry") == change(0.0, 0.0, "odometry") == "as good as odometry"
