# SPDX-License-Identifier: Apache-2.0
"""Thinning takes evenly from all objects, keeps the order, and leaves each enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.keyframes.fewer_points import LEAST_POINTS, NEAREST_M, in_front, thinned
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import FrameWindow
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.simulation.drawn_place import drawn


def place() -> Keyframe:
    return fuse(FrameWindow.of(drawn(0)), RegistrarParams())


def test_each_object_gives_its_share_and_keeps_its_order() -> None:
    keyframe = place()
    total = sum(len(item.cloud) for item in keyframe.objects)
    back = thinned(keyframe, total / 4)
    for before, after in zip(keyframe.objects, back.objects, strict=True):
        assert len(after.cloud) == int(0.75 * len(before.cloud)) > LEAST_POINTS
        rows = [int(np.flatnonzero((before.cloud.xyz == point).all(axis=1))[0]) for point in after.cloud.xyz]
        assert rows == sorted(set(rows))
        assert np.diff(rows).max() == 2
        assert np.array_equal(after.cloud.normals, before.cloud.normals[rows])


def test_an_object_keeps_the_least_or_all_that_it_has() -> None:
    keyframe = place()
    few = thinned(keyframe, 1e9)
    assert [len(item.cloud) for item in few.objects] == [LEAST_POINTS] * 2
    assert np.array_equal(thinned(few, 1e9).objects[0].cloud.xyz, few.objects[0].cloud.xyz)


def test_what_is_not_before_the_camera_is_left_out() -> None:
    keyframe = place()
    near, whole = keyframe.objects
    xyz = near.cloud.xyz.copy()
    xyz[:5, 2] = [-1.0, 0.0, 0.5 * NEAREST_M, NEAREST_M, 1.0]
    behind = replace(near, cloud=replace(near.cloud, xyz=-near.cloud.xyz))
    back = in_front(replace(keyframe, objects=(replace(near, cloud=replace(near.cloud, xyz=xyz)), behind, whole)))
    assert [item.label for item in back.objects] == [near.label, whole.label]
    assert np.array_equal(back.objects[0].cloud.xyz, xyz[3:])
