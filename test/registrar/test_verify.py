# SPDX-License-Identifier: Apache-2.0
"""Tests of the whole-view check."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.verify import floating, verify
from objreg_ros.registrar.visibility import prepare_sight

from .rooms import keyframe, seen_from

PARAMS = RegistrarParams()


@pytest.fixture(scope="module")
def sights():
    return tuple(prepare_sight(keyframe(seen_from(a), seed=k).view, 4.0, 3.0) for k, a in enumerate((0.0, 25.0)))


TRUTH = inverse(seen_from(25.0)) @ seen_from(0.0)


def test_the_true_pose_is_believed(sights) -> None:
    found = verify(*sights, TRUTH, PARAMS)
    assert found.score > 0.5
    assert found.violations < 0.05
    assert found.texture is not None and found.texture > 0.5


def test_both_ways_round_give_the_same_answer(sights) -> None:
    forward, backward = verify(*sights, TRUTH, PARAMS), verify(sights[1], sights[0], inverse(TRUTH), PARAMS)
    assert forward.score == pytest.approx(backward.score, abs=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_a_pose_off_by_twenty_centimetres_is_worth_less(sights, axis: int) -> None:
    shift = pose(np.eye(3), 0.2 * np.eye(3)[axis])
    assert verify(*sights, shift @ TRUTH, PARAMS).score < verify(*sights, TRUTH, PARAMS).score - 0.2


def test_views_that_do_not_meet_are_not_tested(sights) -> None:
    away = pose(rotation_from_vector(np.array([0.0, np.pi, 0.0])), np.zeros(3))
    found = verify(*sights, away, PARAMS)
    assert found.tested == 0 and found.score == -3.0 and found.texture is None


def test_a_ragged_edge_does_not_float_and_a_thing_that_is_gone_does(sights) -> None:
    assert floating(*sights, TRUTH, PARAMS) < 0.01
    a_little_off = pose(np.eye(3), np.array([0.03, 0.0, 0.0])) @ TRUTH
    assert floating(*sights, a_little_off, PARAMS) < verify(*sights, a_little_off, PARAMS).violations
    far_off = pose(np.eye(3), np.array([0.0, 0.0, -0.4])) @ TRUTH
    assert floating(*sights, far_off, PARAMS) > 0.1


def test_views_that_do_not_meet_float_altogether(sights) -> None:
    assert floating(*sights, pose(np.eye(3), np.array([0.0, 0.0, 90.0])), PARAMS) == 1.0
