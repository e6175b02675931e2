# SPDX-License-Identifier: Apache-2.0
"""Tests of what a pose says of the objects, and of what the objects say of a pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose
from objreg_ros.registrar.candidate import Verification
from objreg_ros.registrar.objects import Liking, explain, gain, liked
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import prepare

from .rooms import keyframe, seen_from

PARAMS = RegistrarParams()


def liking(score: float, likeness: float, texture: float | None = 0.9, tested: int = 5000) -> Liking:
    seen = Verification(inliers=0.9, violations=0.0, occluded=0.0, texture=texture, tested=tested, score=score)
    return Liking(seen, likeness)


def test_the_middle_of_a_large_thing_may_wander_with_the_side_that_is_seen() -> None:
    here = prepare(keyframe(seen_from(0.0), seed=1), PARAMS)
    aside = pose(np.eye(3), np.array([0.13, 0.0, 0.0]))

    def explained(extent: float) -> int:
        grown = replace(here, extents=np.full(len(here.extents), extent))
        return len(explain(grown, grown, aside, PARAMS)[0])

    assert explained(0.1) == 0 and explained(1.0) == len(here.groups)


def test_the_true_pose_is_liked_more_than_one_beside_it() -> None:
    here, there = (prepare(keyframe(seen_from(angle), seed=k), PARAMS) for k, angle in enumerate((0.0, 20.0)))
    truth = inverse(seen_from(20.0)) @ seen_from(0.0)
    aside = pose(np.eye(3), np.array([0.02, 0.0, 0.0])) @ truth
    explained, _ = explain(here, there, truth, PARAMS)
    right, wrong = (liked(here, there, T, explained, PARAMS) for T in (truth, aside))
    assert gain(right, wrong, PARAMS) > 0.0 > gain(wrong, right, PARAMS)


def test_where_much_grey_correlates_objects_do_not_outvote_it() -> None:
    assert gain(liking(1.05, 0.4), liking(1.0, 1.0), PARAMS) > 0.0


@pytest.mark.parametrize(("texture", "tested"), [(0.9, 200), (0.3, 1000), (0.0, 5000), (-0.2, 5000), (None, 5000)])
def test_where_grey_says_little_objects_decide(texture: float | None, tested: int) -> None:
    alike, unlike = (liking(score, likeness, texture, tested) for score, likeness in ((1.0, 1.0), (1.05, 0.4)))
    assert gain(unlike, alike, PARAMS) < 0.0


def test_one_gains_what_the_other_loses() -> None:
    a, b = liking(1.0, 0.3, 0.8), liking(0.9, 0.9, 0.5)
    assert gain(a, b, PARAMS) == pytest.approx(-gain(b, a, PARAMS))


def test_views_that_do_not_meet_leave_all_to_the_objects() -> None:
    nothing = liking(-3.0, 0.0, 0.5, tested=0)
    assert gain(liking(-3.0, 1.0, 0.5, tested=0), nothing, PARAMS) == pytest.approx(PARAMS.likeness_weight)
