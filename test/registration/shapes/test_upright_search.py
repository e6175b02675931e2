# SPDX-License-Identifier: Apache-2.0
"""Tests of the registration of one object upon another."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, transform
from objreg_ros.registration.prepare.prepared import SHAPE_POINTS
from objreg_ros.registration.shapes.shape import Shape, prepare_shape
from objreg_ros.registration.shapes.upright_search import REFINED, coarse_poses, improve, register_shapes
from registration.drawn_shapes import BOX, ELL, error, from_side, keyframe


def shape_of(thing: object, angle: float, seed: int = 0) -> Shape:
    made = prepare_shape(keyframe(from_side(angle), {"thing": thing}, seed=seed), [0], SHAPE_POINTS)
    assert made is not None
    return made


@pytest.mark.parametrize("angle", [20.0, 60.0, 90.0, 120.0])
def test_an_ell_is_laid_upon_itself_from_every_side(angle: float) -> None:
    best = register_shapes(shape_of(ELL, angle, 1), shape_of(ELL, 0.0, 2))[0]
    degrees, centimetres = error(best.T_target_source, angle, 0.0)
    assert degrees < 3.0 and centimetres < 1.5
    assert best.score > 0.1


def test_a_box_is_laid_upon_itself_up_to_half_a_turn() -> None:
    best = register_shapes(shape_of(BOX, 50.0, 1), shape_of(BOX, 0.0, 2))[0]
    degrees, centimetres = error(best.T_target_source, 50.0, 0.0)
    assert min(degrees, abs(180.0 - degrees)) < 3.0 and centimetres < 1.5


def test_a_can_is_found_where_it_stands_whatever_its_yaw() -> None:
    best = register_shapes(shape_of((0.0, 0.0), 70.0, 1), shape_of((0.0, 0.0), 0.0, 2))[0]
    assert error(best.T_target_source, 70.0, 0.0)[1] < 1.0


def test_poses_come_best_first_and_upright() -> None:
    source, target = shape_of(ELL, 30.0, 1), shape_of(ELL, 0.0, 2)
    found = register_shapes(source, target)
    assert [fit.score for fit in found] == sorted((fit.score for fit in found), reverse=True)
    for fit in found:
        up = fit.T_target_source[:3, :3] @ source.R_upright_camera[2]
        assert np.allclose(up, target.R_upright_camera[2], atol=1e-9)


def test_another_thing_looks_less_alike() -> None:
    target = shape_of(ELL, 0.0, 2)
    same = register_shapes(shape_of(ELL, 20.0, 1), target)[0]
    other = register_shapes(shape_of(BOX, 20.0, 1), target)[0]
    assert other.score < same.score - 0.5


def test_a_pose_nearby_is_improved() -> None:
    source, target = shape_of(ELL, 25.0, 1), shape_of(ELL, 0.0, 2)
    rough = inverse(from_side(0.0)) @ from_side(25.0)
    rough[0, 3] += 0.02  # the camera's x is level
    better = improve(source, target, np.array([rough]))[0].T_target_source
    assert error(better, 25.0, 0.0)[1] < 0.5 * error(rough, 25.0, 0.0)[1]


def test_a_glance_proposes_as_many_as_asked() -> None:
    source, target = shape_of(ELL, 25.0, 1), shape_of(ELL, 0.0, 2)
    proposed = coarse_poses(source, target, 3)
    assert len(proposed) == 3
    foot = transform(proposed[0], source.foot)
    assert np.linalg.norm(foot - target.foot) < 0.1


def test_both_ways_round_are_kept_of_what_looks_much_the_same_after_half_a_turn() -> None:
    found = register_shapes(shape_of(BOX, 20.0, 1), shape_of(BOX, 0.0, 2))
    turns = [error(fit.T_target_source, 20.0, 0.0)[0] for fit in found]
    assert min(turns) < 5.0 and max(turns) > 175.0
    assert sum(turn < 20.0 for turn in turns) < REFINED - 1
