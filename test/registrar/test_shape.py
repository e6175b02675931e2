# SPDX-License-Identifier: Apache-2.0
"""Tests of a shape and of upright motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error, transform
from objreg_ros.registrar.keyframe import Context, KeyObject
from objreg_ros.registrar.shape import footing, prepare_shape, upright_axes, upright_motion, upright_pose

from .shapes import BOX, ELL, from_side, keyframe


def test_the_footing_is_the_table_under_the_object() -> None:
    key = keyframe(from_side(20.0), {"book": (((-0.1, -0.1, 0.0), (0.1, 0.1, 0.02)),)})
    shape = prepare_shape(key, [0], 400)
    assert shape is not None
    assert abs(transform(from_side(20.0), shape.foot)[2]) < 0.002


def test_without_a_surface_the_lowest_points_are_the_footing() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    bare = replace(key, context=Context(xyz=np.zeros((0, 3), np.float32), normals=np.zeros((0, 3), np.float32)))
    R = upright_axes(-np.asarray(key.gravity))
    assert abs(footing(bare, 0, R) - footing(key, 0, R)) < 0.02


def test_too_few_points_or_no_gravity_make_no_shape() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    assert prepare_shape(replace(key, gravity=None), [0], 400) is None
    cloud = key.objects[0].cloud
    few = replace(cloud, xyz=cloud.xyz[:20], normals=cloud.normals[:20], flags=cloud.flags[:20])
    assert prepare_shape(replace(key, objects=(KeyObject(cloud=few),)), [0], 400) is None
    assert prepare_shape(key, [], 400) is None


def test_the_same_keyframe_gives_the_same_shape() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    a, b = prepare_shape(key, [0], 400), prepare_shape(key, [0], 400)
    assert a is not None and b is not None
    assert np.array_equal(a.xyz, b.xyz) and np.array_equal(a.silhouette.depth, b.silhouette.depth)


@pytest.mark.parametrize("angle", [0.0, 75.0, 180.0])
def test_an_upright_motion_is_a_pose_and_back(angle: float) -> None:
    source = prepare_shape(keyframe(from_side(angle), {"ell": ELL}), [0], 400)
    target = prepare_shape(keyframe(from_side(0.0), {"ell": ELL}), [0], 400)
    assert source is not None and target is not None
    truth = inverse(from_side(0.0)) @ from_side(angle)
    motion = upright_motion(source, target, truth)
    degrees, centimetres = pose_error(upright_pose(source, target, motion), truth)
    assert degrees < 1e-4 and centimetres < 1e-4
    assert abs(motion[3]) < 0.003
