# SPDX-License-Identifier: Apache-2.0
"""Tests of a shape and of upright motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error, rotation_from_vector, transform
from objreg_ros.registration.keyframe import Context, KeyObject
from objreg_ros.registration.shapes.shape import (
    footing,
    layer_around,
    prepare_shape,
    standing,
    turned_half,
    upright_axes,
    upright_motion,
    upright_pose,
)
from registration.drawn_shapes import BOX, ELL, from_side, keyframe

NOTHING = Context(xyz=np.zeros((0, 3), np.float32), normals=np.zeros((0, 3), np.float32))


def test_the_footing_is_the_table_under_the_object() -> None:
    key = keyframe(from_side(20.0), {"book": (((-0.1, -0.1, 0.0), (0.1, 0.1, 0.02)),)})
    shape = prepare_shape(key, [0], 400)
    assert shape is not None
    assert abs(transform(from_side(20.0), shape.foot)[2]) < 0.002


def test_a_seat_is_not_what_a_chair_stands_on() -> None:
    seat = (((-0.2, -0.2, 0.0), (0.2, 0.2, 0.4)), ((-0.2, 0.16, 0.4), (0.2, 0.2, 0.8)))
    key = keyframe(from_side(-30.0, 1.6), {"chair": seat})
    chair = key.objects[0].cloud
    upper = transform(from_side(-30.0, 1.6), chair.xyz)[:, 2] > 0.39
    cut = replace(chair, xyz=chair.xyz[upper], normals=chair.normals[upper], flags=chair.flags[upper])
    within = Context(  # what the box of the chair left out is context
        xyz=np.concatenate([key.context.xyz, chair.xyz[::9]]),
        normals=np.concatenate([key.context.normals, chair.normals[::9]]),
    )
    key = replace(key, objects=(KeyObject(cloud=cut),), context=within)
    up = -np.asarray(key.gravity)
    at = chair.xyz.mean(axis=0)
    foot = at + (footing(key, 0, upright_axes(up)) - at @ up) * up
    assert abs(transform(from_side(-30.0, 1.6), foot)[2]) < 0.03


def test_a_rung_under_an_object_is_not_what_it_stands_on() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    R = upright_axes(-np.asarray(key.gravity))
    level = key.context.normals @ R[2].astype(np.float32) > 0.9
    low = footing(key, 0, R)
    beside = key.context.xyz[level & (np.linalg.norm(key.context.xyz - key.objects[0].centroid, axis=1) < 0.25)][:8]
    rung = beside + (0.1 * R[2]).astype(np.float32)
    lifted = replace(key.objects[0].cloud, xyz=key.objects[0].cloud.xyz + (0.2 * R[2]).astype(np.float32))
    upon = Context(
        xyz=np.concatenate([key.context.xyz, rung]),
        normals=np.concatenate([key.context.normals, np.tile(R[2].astype(np.float32), (len(rung), 1))]),
    )
    assert abs(footing(replace(key, objects=(KeyObject(cloud=lifted),), context=upon), 0, R) - low) < 0.005


def test_the_plane_under_an_object_says_where_up_is_better_than_gravity() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    truth = -np.asarray(key.gravity)
    guess = rotation_from_vector(np.radians([1.0, 0.0, 1.0])) @ truth
    assert standing(key, [0], guess) @ truth > np.cos(np.radians(0.1))


def test_a_board_that_tilts_much_is_not_level_and_without_a_board_gravity_says_where_up_is() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    guess = rotation_from_vector(np.radians([9.0, 0.0, 0.0])) @ -np.asarray(key.gravity)
    bare = replace(key, context=NOTHING)
    assert np.array_equal(standing(key, [0], guess), guess)
    assert np.array_equal(standing(bare, [0], guess), guess)


def test_without_a_surface_the_lowest_points_are_the_footing() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    bare = replace(key, context=NOTHING)
    R = upright_axes(-np.asarray(key.gravity))
    assert abs(footing(bare, 0, R) - footing(key, 0, R)) < 0.02


def test_level_points_of_all_heights_are_no_surface() -> None:
    key = keyframe(from_side(20.0), {"box": BOX})
    R = upright_axes(-np.asarray(key.gravity))
    beside = key.objects[0].centroid + 0.2 * R[0] - np.linspace(0.1, 1.0, 12)[:, None] * R[2]
    steps = Context(xyz=beside.astype(np.float32), normals=np.tile(R[2].astype(np.float32), (len(beside), 1)))
    assert footing(replace(key, context=steps), 0, R) == pytest.approx(footing(replace(key, context=NOTHING), 0, R))


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


def test_layers_that_are_known_already_make_the_same_shape() -> None:
    key = keyframe(from_side(20.0), {"box": BOX, "ell": ELL})
    up = -np.asarray(key.gravity, float)
    layers = [layer_around(key, i, up) for i in range(2)]
    a, b = prepare_shape(key, [0, 1], 400), prepare_shape(key, [0, 1], 400, layers=layers)
    assert a is not None and b is not None and min(map(len, layers)) > 0
    assert np.array_equal(a.xyz, b.xyz) and np.array_equal(a.R_upright_camera, b.R_upright_camera)


@pytest.mark.parametrize("angle", [0.0, 75.0, 180.0])
def test_an_upright_motion_is_a_pose_and_back(angle: float) -> None:
    source = prepare_shape(keyframe(from_side(angle), {"ell": ELL}), [0], 400)
    target = prepare_shape(keyframe(from_side(0.0), {"ell": ELL}), [0], 400)
    assert source is not None and target is not None
    truth = inverse(from_side(0.0)) @ from_side(angle)
    motion = upright_motion(source, target, truth)
    degrees, centimetres = pose_error(upright_pose(source, target, motion), truth)
    assert degrees < 0.05 and centimetres < 0.05  # as far as the two planes show which way is up
    assert abs(motion[3]) < 0.003


def test_a_motion_turned_half_twice_is_the_motion_again() -> None:
    motion = np.array([0.3, 0.1, -0.2, 0.01])
    (turned,) = turned_half(motion, np.array([0.1]))
    (back,) = turned_half(turned, np.array([0.1]))
    assert np.allclose(turned[1:3] - motion[1:3], 0.1 * np.array([np.cos(0.3), np.sin(0.3)]))
    assert np.allclose(back - motion, [2.0 * np.pi, 0.0, 0.0, 0.0])
