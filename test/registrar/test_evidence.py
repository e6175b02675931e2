# SPDX-License-Identifier: Apache-2.0
"""What tells two poses apart: neither what is hidden, nor that an object looks alike."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.registrar.candidate import ObjectPair
from objreg_ros.registrar.evidence import agreement, lead, worth
from objreg_ros.registrar.params import RegistrarParams

from .samples import candidate

PARAMS = RegistrarParams()
BOX = (ObjectPair(0, 0, "cereal box"),)


def test_a_candidate_leads_by_what_its_views_are_worth_more() -> None:
    one, other = candidate(score=0.6, explained=BOX), candidate(score=0.4, explained=BOX)
    assert lead(one, [one, other], PARAMS) == pytest.approx(0.2)
    assert lead(other, [one, other], PARAMS) == pytest.approx(-0.2)


def test_what_is_hidden_counts_as_if_it_agreed() -> None:
    one, other = candidate(score=0.6, occluded=0.1), candidate(score=0.4, occluded=0.5)
    assert lead(one, [other], PARAMS) == pytest.approx(-0.2)


def test_that_an_object_looks_alike_is_no_lead_and_that_it_looks_otherwise_is_none_to_have() -> None:
    alike, unseen, otherwise = (candidate(score=0.5, explained=BOX, likeness=x) for x in (1.0, 0.0, -0.6))
    assert lead(alike, [unseen], PARAMS) == pytest.approx(0.0)
    assert lead(alike, [otherwise], PARAMS) == pytest.approx(0.6 * PARAMS.likeness_weight)
    assert worth(alike, PARAMS) - worth(unseen, PARAMS) == pytest.approx(PARAMS.likeness_weight)


def test_objects_that_stand_add_to_what_views_say_and_those_that_moved_take_away() -> None:
    assert agreement(BOX, (), None, PARAMS) == pytest.approx(PARAMS.object_bonus)
    assert agreement(BOX, BOX, 0.0, PARAMS) == pytest.approx(0.0)


def test_without_a_rival_a_candidate_leads_by_more_than_any_limit() -> None:
    assert lead(candidate(), [], PARAMS) > 2.0
    assert np.isfinite(lead(candidate(), [], PARAMS))
