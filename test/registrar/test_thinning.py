# SPDX-License-Identifier: Apache-2.0
"""Thinning: one closure a revisit."""

from __future__ import annotations

import pytest
from registration.samples import SECOND

from objreg_ros.registrar.thinning import Thinning

HERE, ELSEWHERE = 0, 1  # sessions


def test_a_pair_near_an_accepted_one_at_both_ends_is_redundant() -> None:
    thinning = Thinning(1.0)
    thinning.accept(HERE, 0, 60 * SECOND)
    assert thinning.redundant(HERE, SECOND // 2, 60 * SECOND + SECOND // 2)
    assert not thinning.redundant(HERE, SECOND // 2, 70 * SECOND)
    assert not thinning.redundant(HERE, 5 * SECOND, 60 * SECOND)


def test_what_came_to_nothing_is_not_in_the_way() -> None:
    thinning = Thinning(1.0)
    thinning.accept(HERE, 0, 60 * SECOND)
    thinning.withdraw(HERE, 0, 60 * SECOND)
    assert not thinning.redundant(HERE, 0, 60 * SECOND)


def test_one_that_came_to_nothing_leaves_those_beside_it() -> None:
    thinning = Thinning(1.0)
    for from_s in (0, 30):
        thinning.accept(HERE, from_s * SECOND, 60 * SECOND)
    thinning.withdraw(HERE, 0, 60 * SECOND)
    assert not thinning.redundant(HERE, 0, 60 * SECOND) and thinning.redundant(HERE, 30 * SECOND, 60 * SECOND)


@pytest.mark.parametrize(
    ("from_s", "to_s", "redundant"),
    [
        (9.1, 59.6, True),
        (10.9, 61.4, True),
        (9.0, 60.5, False),
        (11.0, 60.5, False),
        (10.0, 59.5, False),
        (10.0, 61.5, False),
    ],
)
def test_near_is_less_than_the_span_before_and_after_at_either_end(from_s: float, to_s: float, redundant: bool) -> None:
    thinning = Thinning(1.0)
    thinning.accept(HERE, 10 * SECOND, 60 * SECOND + SECOND // 2)
    assert thinning.redundant(HERE, round(from_s * SECOND), round(to_s * SECOND)) is redundant


def test_without_a_span_only_the_very_pair_is_redundant() -> None:
    thinning = Thinning(0.0)
    thinning.accept(HERE, 5, 7)
    assert thinning.redundant(HERE, 5, 7) and not thinning.redundant(HERE, 5, 8) and not thinning.redundant(HERE, 4, 7)


def test_moments_of_different_sessions_are_not_near_each_other() -> None:
    thinning = Thinning(1.0)
    thinning.accept(HERE, 5, 7)
    assert thinning.redundant(HERE, 5, 7) and not thinning.redundant(ELSEWHERE, 5, 7)


def test_what_was_accepted_before_is_recalled() -> None:
    thinning = Thinning(1.0)
    thinning.recall([(0, 0, 30 * SECOND), (2, 5 * SECOND, 60 * SECOND)])
    assert thinning.redundant(2, 5 * SECOND, 60 * SECOND) and thinning.redundant(0, 0, 30 * SECOND)
    assert not thinning.redundant(0, 5 * SECOND, 60 * SECOND)
