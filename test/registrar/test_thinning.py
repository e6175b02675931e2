# SPDX-License-Identifier: Apache-2.0
"""Thinning: one closure a revisit."""

from __future__ import annotations

from objreg_ros.registrar.thinning import Thinning

from .samples import SECOND


def test_a_pair_near_an_accepted_one_at_both_ends_is_redundant() -> None:
    thinning = Thinning(1.0)
    thinning.accept(0, 60 * SECOND)
    assert thinning.redundant(SECOND // 2, 60 * SECOND + SECOND // 2)
    assert not thinning.redundant(SECOND // 2, 70 * SECOND)
    assert not thinning.redundant(5 * SECOND, 60 * SECOND)


def test_what_came_to_nothing_is_not_in_the_way() -> None:
    thinning = Thinning(1.0)
    thinning.accept(0, 60 * SECOND)
    thinning.withdraw(0, 60 * SECOND)
    assert not thinning.redundant(0, 60 * SECOND)
