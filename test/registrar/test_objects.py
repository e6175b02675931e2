# SPDX-License-Identifier: Apache-2.0
"""Tests of what a pose says of the objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.geometry import pose
from objreg_ros.registrar.objects import explain, likeness
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import prepare

from .rooms import keyframe, seen_from

PARAMS = RegistrarParams()


def test_the_middle_of_a_large_thing_may_wander_with_the_side_that_is_seen() -> None:
    here = prepare(keyframe(seen_from(0.0), seed=1), PARAMS)
    aside = pose(np.eye(3), np.array([0.13, 0.0, 0.0]))

    def explained(extent: float) -> int:
        grown = replace(here, extents=np.full(len(here.extents), extent))
        return len(explain(grown, grown, aside, PARAMS)[0])

    assert explained(0.1) == 0 and explained(1.0) == len(here.groups)


def test_an_object_a_little_aside_looks_more_alike_within_reach_than_where_it_is() -> None:
    here, there = (prepare(keyframe(seen_from(0.0), seed=seed), PARAMS) for seed in (1, 2))
    aside = pose(np.eye(3), np.array([0.04, 0.0, 0.0]))
    explained, _ = explain(here, there, aside, PARAMS)
    where = likeness(here, there, explained, aside, PARAMS)
    what = likeness(here, there, explained, aside, PARAMS, PARAMS.likeness_reach)
    assert explained and where is not None and what is not None
    assert where < what - 0.2
