# SPDX-License-Identifier: Apache-2.0
"""Which objects speak for odometry when they are seen again."""

from __future__ import annotations

from objreg_ros.registrar.localisation.memory import MOST, OLD_NS, Familiar


def test_what_others_saw_before_counts() -> None:
    assert Familiar().counts(5, 0)


def test_what_was_first_seen_beside_nothing_that_counts_does_so_once_it_is_old() -> None:
    familiar = Familiar()
    familiar.see([5], 100, linked=False)
    assert not familiar.counts(5, 200)
    assert familiar.counts(5, 100 + OLD_NS)


def test_what_was_seen_beside_one_that_counts_does_so_at_once_and_goes_on_to() -> None:
    familiar = Familiar()
    familiar.see([5], 100, linked=False)
    familiar.see([5], 200, linked=True)
    familiar.see([5], 300, linked=False)
    assert familiar.counts(5, 400)


def test_the_oldest_are_forgotten() -> None:
    familiar = Familiar()
    familiar.see([1], 0, linked=False)
    familiar.see(range(2, MOST + 2), 1, linked=False)
    assert familiar.counts(1, 2) and not familiar.counts(2, 2)
