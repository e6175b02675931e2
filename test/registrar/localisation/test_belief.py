# SPDX-License-Identifier: Apache-2.0
"""The odds of being elsewhere, by waiting and by evidence."""

from __future__ import annotations

import math

import pytest

from objreg_ros.registrar.localisation.belief import MOST, WAITED, Belief

SECOND = 1_000_000_000


def test_a_minute_without_evidence_makes_it_as_likely_as_the_rate_says() -> None:
    belief = Belief()
    belief.wait(5 * SECOND)
    belief.wait(65 * SECOND)
    assert belief.probability == pytest.approx(1.0 - math.exp(-60.0 / 3600.0), rel=1e-3)


def test_no_wait_is_evidence_enough_and_none_makes_it_less_likely() -> None:
    belief = Belief()
    belief.wait(10**18)
    assert belief.probability < 1e-5  # the first stamp is the beginning, whatever it is
    belief.wait(2 * 10**18)
    assert belief.probability == pytest.approx(WAITED)
    belief.weigh(math.log(100.0))
    before = belief.probability
    belief.wait(3 * 10**18)
    assert belief.probability == before > 0.5


def test_evidence_multiplies_the_odds_within_bounds() -> None:
    belief = Belief()
    belief.settle(100.0)
    belief.weigh(math.log(12.0))
    assert belief.odds == pytest.approx(0.12)
    belief.weigh(1e9)
    assert belief.odds == pytest.approx(math.exp(MOST))


def test_an_earlier_stamp_is_passed_over() -> None:
    belief = Belief()
    belief.wait(10 * SECOND)
    belief.wait(3 * SECOND)
    belief.wait(11 * SECOND)
    assert belief.probability < 1.1 * (1.0 / 3600.0 + 1e-6)


def test_weak_evidence_raises_the_odds_to_its_bound_at_most_and_never_lowers_them() -> None:
    belief = Belief()
    belief.settle(100.0)
    belief.weigh(math.log(12.0), 0.1)
    assert belief.odds == pytest.approx(0.1)
    belief.weigh(math.log(10.0))
    belief.weigh(math.log(10.0), 0.1)
    assert belief.odds == pytest.approx(1.0)
    belief.weigh(-math.log(10.0), 0.1)
    assert belief.odds == pytest.approx(0.1)
