# SPDX-License-Identifier: Apache-2.0
"""Keypoints of a view, and which of two views are matched."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.registration.prepare.keypoints import MOST, Keypoints, find_keypoints, match_keypoints
from objreg_ros.registration.prepare.normals import view_normals
from registration.rooms import keyframe, seen_from

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)


def wall(shift: int = 0, z: float = 2.0, seed: int = 0) -> View:
    """A wall of blots at ``z`` m, which moves so many pixels to the right in the picture."""
    noise = np.random.default_rng(seed).integers(0, 256, (120, 240)).astype(np.uint8)
    blots = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.5), None, 0, 255, cv2.NORM_MINMAX)
    v, u = np.mgrid[0:120, 0:160]
    xyz = np.stack([(u - CAMERA.cx) / CAMERA.fx * z, (v - CAMERA.cy) / CAMERA.fy * z, np.full(u.shape, z)], -1)
    return View(xyz=xyz.astype(np.float32), grey=blots[:, 40 - shift : 200 - shift].copy(), intrinsics=CAMERA)


def test_a_keypoint_lies_on_its_line_of_sight_at_the_depth_of_the_view() -> None:
    found = find_keypoints(wall(z=1.5), farthest=4.0)
    assert 50 < len(found) <= MOST + 50
    assert found.measured.all() and np.allclose(found.xyz[:, 2], 1.5)
    assert np.allclose(found.xyz[:, :2], 1.5 * found.rays)
    assert np.allclose(np.linalg.norm(found.descriptors, axis=1), 1.0, atol=1e-5)


def test_a_picture_that_moves_moves_its_keypoints_by_as_many_pixels() -> None:
    matches = match_keypoints(find_keypoints(wall(), 4.0), find_keypoints(wall(shift=8), 4.0))
    moved = (matches.target.rays[matches.b] - matches.source.rays[matches.a]) * CAMERA.fx
    assert len(matches) > 30
    assert np.median(np.abs(moved - (8.0, 0.0)), axis=0) == pytest.approx((0.0, 0.0), abs=0.1)


def test_no_point_is_known_beyond_the_range_or_without_depth() -> None:
    view = wall(z=5.0)
    assert not find_keypoints(view, farthest=4.0).measured.any()
    blind = replace(view, xyz=np.full_like(view.xyz, np.nan))
    found = find_keypoints(blind, farthest=10.0)
    assert len(found) > 50 and not found.measured.any() and not found.normals.any() and np.isfinite(found.rays).all()


@pytest.mark.parametrize("grey", [None, np.full((120, 160), 90, np.uint8)], ids=["no grey", "plain"])
def test_a_view_without_print_has_no_keypoints(grey: np.ndarray | None) -> None:
    none = find_keypoints(replace(wall(), grey=grey), 4.0)
    assert len(none) == 0 and none.descriptors.shape == (0, 128)
    assert len(match_keypoints(none, find_keypoints(wall(), 4.0))) == 0


def test_matches_are_each_others_nearest_whichever_view_comes_first() -> None:
    a, b = (find_keypoints(keyframe(seen_from(angle)).view, 4.0) for angle in (0.0, 15.0))
    there, back = match_keypoints(a, b, ratio=1.0), match_keypoints(b, a, ratio=1.0).turned()
    assert len(there) > 20
    assert set(zip(there.a, there.b, strict=True)) == set(zip(back.a, back.b, strict=True))
    assert len(set(there.b)) == len(there)


def test_a_print_that_repeats_itself_is_not_matched() -> None:
    tile = wall().grey
    assert tile is not None
    once = find_keypoints(wall(), 4.0)
    twice = Keypoints(*(np.concatenate([part, part]) for part in once[:4]), once.focal_px)
    assert len(match_keypoints(once, twice)) == 0 and len(match_keypoints(once, once)) == len(once)


def test_normals_that_are_known_already_make_the_same_keypoints() -> None:
    view = wall()
    found, again = find_keypoints(view, 4.0), find_keypoints(view, 4.0, view_normals(view.xyz))
    assert len(found) > 0 and found.normals.any() and np.array_equal(found.normals, again.normals)
