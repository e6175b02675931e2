# SPDX-License-Identifier: Apache-2.0
"""Tests of the registration of several objects together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose import object_poses
from objreg_ros.registration.propose.object_poses import _drawn, from_shapes, half_turned, register_scenes
from objreg_ros.registration.shapes.shape import upright_motion
from registration.drawn_shapes import BOX, ELL, error, from_side, keyframe

PARAMS = RegistrarParams()


def beside(boxes: tuple, x: float, y: float) -> tuple:
    return tuple(((a[0] + x, a[1] + y, a[2]), (b[0] + x, b[1] + y, b[2])) for a, b in boxes)


THREE = {"box": beside(BOX, -0.1, 0.22), "ell": beside(ELL, 0.1, -0.15), "can": (0.02, 0.1)}


@pytest.mark.parametrize("angle", [40.0, 150.0])
def test_three_objects_give_the_whole_pose(angle: float) -> None:
    source = prepare(keyframe(from_side(angle), THREE, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), THREE, seed=2), PARAMS)
    degrees, centimetres = error(register_scenes(source, target)[0].T_target_source, angle, 0.0)
    assert degrees < 2.0 and centimetres < 1.5


def test_objects_of_other_kinds_are_not_laid_upon_each_other() -> None:
    source = prepare(keyframe(from_side(40.0), {"ell": ELL}, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), {"box": BOX}, seed=2), PARAMS)
    assert from_shapes(source, target) == []


def test_without_gravity_nothing_is_proposed() -> None:
    key = replace(keyframe(from_side(0.0), THREE), gravity=None)
    source, target = prepare(key, PARAMS), prepare(keyframe(from_side(40.0), THREE), PARAMS)
    assert from_shapes(source, target) == []


def test_what_was_seen_around_objects_draws_their_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    source = prepare(keyframe(from_side(30.0), THREE, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), THREE, seed=2), PARAMS)
    truth = inverse(from_side(0.0)) @ from_side(30.0)
    off = truth @ pose(rotation_from_vector(np.radians([1.5, 2.0, 0.0])), np.array([0.0, 0.01, 0.01]))
    a, b = source.scene, target.scene
    assert a is not None and b is not None
    start = upright_motion(a, b, off)
    drawn = _drawn(source, target, a, b, start)
    assert np.abs(drawn - upright_motion(a, b, truth)).max() < 0.5 * np.abs(start - upright_motion(a, b, truth)).max()
    monkeypatch.setattr(object_poses, "ALIGNED_REACH_M", 0.0)
    assert np.array_equal(_drawn(source, target, a, b, start), start)


PAIR = ObjectPair(0, 0, "ell")


@pytest.mark.parametrize("angle", [30.0, 160.0])
def test_from_the_pose_that_takes_front_for_back_a_half_turn_comes_near_the_true_one(angle: float) -> None:
    source = prepare(keyframe(from_side(angle), {"ell": ELL}, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), {"ell": ELL}, seed=2), PARAMS)
    truth = inverse(from_side(0.0)) @ from_side(angle)
    assert target.up is not None
    R, middle = rotation_from_vector(np.pi * target.up), transform(truth, source.centroids[0])
    alias = pose(R, middle - R @ middle) @ truth
    found = half_turned(source, target, PAIR, alias)
    assert found is not None
    degrees, centimetres = error(found, angle, 0.0)
    assert degrees < 15.0 and centimetres < 6.0


def test_an_object_without_a_shape_is_not_turned() -> None:
    key = replace(keyframe(from_side(0.0), {"ell": ELL}), gravity=None)
    one = prepare(key, PARAMS)
    assert half_turned(one, one, PAIR, np.eye(4)) is None
