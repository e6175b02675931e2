# SPDX-License-Identifier: Apache-2.0
"""Tests of the registration of several objects together."""

from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import prepare
from objreg_ros.registrar.scene_search import from_shapes, register_scenes

from .shapes import BOX, ELL, error, from_side, keyframe

PARAMS = RegistrarParams()


def beside(boxes: tuple, x: float, y: float) -> tuple:
    return tuple(((a[0] + x, a[1] + y, a[2]), (b[0] + x, b[1] + y, b[2])) for a, b in boxes)


THREE = {"box": beside(BOX, -0.1, 0.22), "ell": beside(ELL, 0.1, -0.15), "can": (0.02, 0.1)}


@pytest.mark.parametrize("angle", [40.0, 150.0])
def test_three_objects_tell_the_whole_pose(angle: float) -> None:
    source = prepare(keyframe(from_side(angle), THREE, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), THREE, seed=2), PARAMS)
    degrees, centimetres = error(register_scenes(source, target, PARAMS)[0].T_target_source, angle, 0.0)
    assert degrees < 2.0 and centimetres < 1.5


def test_objects_of_other_kinds_are_not_laid_upon_each_other() -> None:
    source = prepare(keyframe(from_side(40.0), {"ell": ELL}, seed=1), PARAMS)
    target = prepare(keyframe(from_side(0.0), {"box": BOX}, seed=2), PARAMS)
    assert from_shapes(source, target, PARAMS) == []


def test_without_gravity_nothing_is_proposed() -> None:
    key = replace(keyframe(from_side(0.0), THREE), gravity=None)
    source, target = prepare(key, PARAMS), prepare(keyframe(from_side(40.0), THREE), PARAMS)
    assert from_shapes(source, target, PARAMS) == []
