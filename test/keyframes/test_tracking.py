# SPDX-License-Identifier: Apache-2.0
"""Tracking: the motion between two views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import CAMERA, moved, scene_view

from objreg_ros.data.frames import View
from objreg_ros.geometry import pose, pose_error, rotation_from_vector
from objreg_ros.keyframes.tracking import same_picture, tracked_surface, view_motion

MOTIONS = [
    pose(rotation_from_vector(np.array([0.0, 0.02, 0.0])), np.array([0.02, 0.0, 0.01])),
    pose(rotation_from_vector(np.array([0.02, -0.02, 0.02])), np.array([-0.03, 0.02, 0.0])),
]


@pytest.mark.parametrize("T", MOTIONS)
def test_a_small_motion_is_found_to_a_millimetre(T: np.ndarray) -> None:
    found = view_motion(scene_view(T), tracked_surface(scene_view()))
    assert found is not None
    rotation, distance = pose_error(found, T)
    assert rotation < 0.1 and distance < 0.3


def test_grey_holds_where_a_plain_wall_would_slide() -> None:
    v, u = np.mgrid[0:120, 0:160].astype(np.float32)

    def wall(shift: float) -> View:
        x, y = (u - CAMERA.cx) / CAMERA.fx * 2.0, (v - CAMERA.cy) / CAMERA.fy * 2.0
        grey = 128 + 50 * np.sin(9 * (x + shift)) + 50 * np.sin(11 * y)
        xyz = np.stack([x, y, np.full_like(x, 2.0)], axis=-1).astype(np.float32)
        return View(xyz=xyz, grey=grey.astype(np.uint8), intrinsics=CAMERA)

    found = view_motion(wall(0.02), tracked_surface(wall(0.0)))
    assert found is not None and pose_error(found, moved(0.02))[1] < 0.3


def test_a_guess_makes_a_larger_motion_reachable() -> None:
    T = pose(rotation_from_vector(np.array([0.0, 0.3, 0.0])), np.array([0.3, 0.0, 0.0]))
    found = view_motion(scene_view(T), tracked_surface(scene_view()), T @ MOTIONS[0])
    assert found is not None and pose_error(found, T)[0] < 0.2


def test_a_view_without_grey_is_aligned_by_its_shape() -> None:
    found = view_motion(replace(scene_view(MOTIONS[0]), grey=None), tracked_surface(scene_view()))
    assert found is not None and max(pose_error(found, MOTIONS[0])) < 0.1


def test_what_moved_by_itself_or_changed_its_colour_hardly_moves_the_rest() -> None:
    view = scene_view(MOTIONS[0])
    xyz, grey = view.xyz.copy(), view.grey.copy()
    xyz[40:80, 40:80] *= 0.98
    grey[20:60, 100:140] = 255
    for other in (replace(view, xyz=xyz), replace(view, grey=grey)):
        found = view_motion(other, tracked_surface(scene_view()))
        assert found is not None and pose_error(found, MOTIONS[0])[1] < 0.25


def test_a_brighter_picture_is_no_motion() -> None:
    view = scene_view(MOTIONS[0])
    found = view_motion(replace(view, grey=view.grey + np.uint8(25)), tracked_surface(scene_view()))
    assert found is not None and pose_error(found, MOTIONS[0])[1] < 0.25


@pytest.mark.parametrize(("nearer", "found"), [(60, True), (100, False)])
def test_a_motion_is_believed_where_most_of_the_view_agrees(nearer: int, found: bool) -> None:
    view = scene_view(MOTIONS[0])
    xyz = view.xyz.copy()
    xyz[:, :nearer] *= 0.5
    assert (view_motion(replace(view, xyz=xyz), tracked_surface(scene_view())) is not None) is found


@pytest.mark.parametrize(("side", "found"), [(30, False), (60, True)])
def test_a_few_pixels_give_no_motion(side: int, found: bool) -> None:
    view = scene_view(MOTIONS[0])
    xyz = np.full_like(view.xyz, np.nan)
    xyz[30 : 30 + side, 60 : 60 + side] = view.xyz[30 : 30 + side, 60 : 60 + side]
    assert (view_motion(replace(view, xyz=xyz), tracked_surface(scene_view())) is not None) is found


def test_two_views_of_different_scenes_have_no_motion() -> None:
    nothing = View(xyz=np.full((120, 160, 3), np.nan, np.float32), grey=None, intrinsics=CAMERA)
    assert view_motion(scene_view(), tracked_surface(nothing)) is None
    assert view_motion(nothing, tracked_surface(scene_view())) is None


def test_views_show_the_same_where_they_lie_and_not_aside() -> None:
    view, surface = scene_view(MOTIONS[0]), tracked_surface(scene_view())
    assert same_picture(view, surface, MOTIONS[0]) > 0.98
    assert same_picture(replace(view, grey=view.grey // 2 + np.uint8(40)), surface, MOTIONS[0]) > 0.98
    assert same_picture(view, surface, moved(0.2) @ MOTIONS[0]) < 0.7
    assert same_picture(view, surface, moved(9.0)) == 0.0


def test_a_view_without_grey_or_contrast_contradicts_nothing() -> None:
    view = scene_view()
    dull = replace(view, grey=np.random.default_rng(1).integers(90, 99, view.grey.shape).astype(np.uint8))
    for one, other in ((replace(view, grey=None), view), (view, replace(view, grey=None)), (dull, dull)):
        assert same_picture(one, tracked_surface(other), moved(0.2)) == 1.0
