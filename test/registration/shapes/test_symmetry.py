# SPDX-License-Identifier: Apache-2.0
"""Tests of yaw that a shape does not show."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.registration.prepare.prepared import SHAPE_POINTS
from objreg_ros.registration.shapes import symmetry
from objreg_ros.registration.shapes.shape import prepare_shape
from objreg_ros.registration.shapes.symmetry import shows_yaw, turned_violations, yaw_share
from registration.drawn_shapes import ELL, from_side, keyframe

UP = np.array([0.0, -1.0, 0.0])  # a level camera: y down


def cloud(xyz: np.ndarray, normals: np.ndarray) -> ObjectCloud:
    return ObjectCloud(
        label="thing", score=1.0, instance=1, xyz=xyz.astype(np.float32), normals=normals.astype(np.float32), rgb=None,
        flags=np.zeros(len(xyz), np.uint16), density=1e4,
    )  # fmt: skip


def half_can(noise: float = 0.0) -> ObjectCloud:
    rng = np.random.default_rng(0)
    angle, height = rng.uniform(np.pi, 2 * np.pi, 800), rng.uniform(0, 0.12, 800)
    normals = np.stack([np.cos(angle), np.zeros(800), np.sin(angle)], axis=1)
    xyz = 0.033 * normals + np.stack([np.zeros(800), height, np.full(800, 0.8)], axis=1)
    return cloud(xyz, normals + rng.normal(0, noise, normals.shape))


def corner_of_a_box() -> ObjectCloud:
    rng = np.random.default_rng(0)
    a, h = rng.uniform(0, 0.1, (2, 800))
    front = np.stack([a, h, np.full(800, 0.8)], axis=1), np.tile([0.0, 0, -1], (800, 1))
    side = np.stack([np.zeros(800), h, 0.8 + a], axis=1), np.tile([-1.0, 0, 0], (800, 1))
    return cloud(np.concatenate([front[0], side[0]]), np.concatenate([front[1], side[1]]))


def test_a_can_does_not_show_its_yaw() -> None:
    assert yaw_share(half_can(), UP) < 0.01


def test_noise_of_the_normals_does_not_make_a_can_show_it() -> None:
    assert yaw_share(half_can(0.1), UP) < 0.07


def test_two_sides_of_a_box_do() -> None:
    assert yaw_share(corner_of_a_box(), UP) > 0.2


def test_a_cloud_without_normals_is_not_called_symmetric() -> None:
    assert yaw_share(cloud(np.zeros((20, 3)), np.zeros((20, 3))), UP) == 1.0


def test_what_is_not_round_would_stand_in_seen_free_space_if_it_were_turned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(symmetry, "TURN_SHARE", 1.0)  # no surface shows a yaw
    for angle in (0.0, 70.0, 200.0):
        for thing, shown in ((ELL, True), ((0.0, 0.0), False)):
            seen = keyframe(from_side(angle), {"thing": thing})
            shape = prepare_shape(seen, [0], SHAPE_POINTS)
            assert shape is not None and (turned_violations(shape) > 0.1) is shown
            assert shows_yaw(seen.objects[0].cloud, -np.asarray(seen.gravity), shape) is shown


def test_where_up_is_unknown_no_yaw_is_shown() -> None:
    assert not shows_yaw(corner_of_a_box(), None, None)
    assert shows_yaw(corner_of_a_box(), UP, None)
