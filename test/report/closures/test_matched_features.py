# SPDX-License-Identifier: Apache-2.0
"""Features are drawn where the pictures have them, few, spread, and only those with which the pose agrees."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import pose
from objreg_ros.registration.prepare.keypoints import KeypointMatches, Keypoints
from objreg_tools.report.closures.matched_features import (
    MOST,
    counted,
    ends_of,
    feature_lines,
    keypoints_in,
    lines_as_svg,
    spread,
)

CAMERA = Intrinsics(fx=500.0, fy=500.0, cx=319.5, cy=239.5, width=640, height=480)
SHIFT_PX, DEPTH_M = 40, 2.0
T_FIRST_SECOND = pose(np.eye(3), np.array([SHIFT_PX * DEPTH_M / CAMERA.fx, 0.0, 0.0]))


def wall(shift_px: int, depth_m: float = DEPTH_M) -> DepthImage:
    """A printed wall, seen by a camera that stands so many pixels of it to the right."""
    print_ = np.random.default_rng(0).integers(0, 255, (60, 100), np.uint8)
    grey = cv2.resize(print_, (1000, 600), interpolation=cv2.INTER_CUBIC)[:480, shift_px : shift_px + 640]
    depth = np.full((480, 640), depth_m, np.float32)
    return DepthImage(depth=depth, rgb=np.dstack([grey] * 3), intrinsics=CAMERA, stamp_ns=0)


FIRST, SECOND = keypoints_in(wall(0)), keypoints_in(wall(SHIFT_PX))


def test_lines_tie_the_same_spot_of_the_wall_in_both_pictures() -> None:
    found = feature_lines(FIRST, SECOND, (CAMERA, CAMERA), T_FIRST_SECOND)
    assert found.agreeing > 100 and found.ends.dtype == int and found.ends.shape == (MOST, 4)
    apart = found.ends[:, 2:] - found.ends[:, :2]
    assert np.abs(apart - (328 - SHIFT_PX / 2, 0)).max() <= 3
    assert found.text == f"{found.agreeing} of {found.matched} matched features agree with the pose, {MOST} are drawn"


def test_a_false_pose_and_a_wall_without_depth_have_no_lines() -> None:
    off = T_FIRST_SECOND @ pose(np.eye(3), np.array([0.3, 0.0, 0.0]))
    false = feature_lines(FIRST, SECOND, (CAMERA, CAMERA), off)
    assert false.ends.shape == (0, 4) and false.agreeing == 0 and false.matched > 100
    flat = [keypoints_in(wall(shift, depth_m=0.0)) for shift in (0, SHIFT_PX)]
    blind = feature_lines(flat[0], flat[1], (CAMERA, CAMERA), T_FIRST_SECOND)
    assert len(blind.ends) == 0 and blind.text.startswith("0 of ")


def test_a_picture_without_print_has_no_features() -> None:
    blank = DepthImage(
        depth=np.full((480, 640), 2.0, np.float32), rgb=np.full((480, 640, 3), 90, np.uint8), intrinsics=CAMERA,
        stamp_ns=0,
    )  # fmt: skip
    bare = keypoints_in(blank)
    found = feature_lines(bare, FIRST, (CAMERA, CAMERA), np.eye(4))
    assert len(bare) == 0 and found.matched == 0 and found.ends.shape == (0, 4)


def test_ends_lie_in_the_picture_of_their_camera() -> None:
    rays = np.array([[0.0, 0.0], [0.5, -0.25]])
    nothing = np.zeros((2, 3))
    seen = Keypoints(rays, nothing, nothing, np.zeros((2, 128), np.float32), 125.0)
    every = np.arange(2)
    wide = Intrinsics(fx=1000.0, fy=1000.0, cx=640.0, cy=360.0, width=1280, height=720)
    ends = ends_of(KeypointMatches(seen, seen, every, every[::-1]), (CAMERA, wide))
    assert ends.tolist() == [[285, 57, 488, 90], [160, 120, 613, 28]]


def test_the_lines_that_are_kept_are_spread_over_the_pictures() -> None:
    rng = np.random.default_rng(0)
    crowd = rng.integers(0, 20, (500, 4))
    corners = np.array([[300, 10, 600, 10], [10, 200, 340, 200], [300, 200, 600, 200]])
    chosen = spread(np.concatenate([crowd, corners]), 10)
    assert len(chosen) == 10 and {500, 501, 502} <= {*chosen.tolist()} and (np.diff(chosen) > 0).all()
    assert spread(crowd[:3], 10).tolist() == [0, 1, 2] and spread(crowd[:0], 10).tolist() == []
    assert len(spread(np.zeros((5, 4), int), 3)) == 3


@pytest.mark.parametrize(
    ("some", "text"),
    [
        (0, "0 of 50 matched features agree with the pose"),
        (41, "41 of 50 matched features agree with the pose, 40 are drawn"),
    ],
)
def test_counts_say_how_many_are_drawn_where_some_are_not(some: int, text: str) -> None:
    assert counted(some, 50) == text


def test_a_line_has_a_dot_at_either_end() -> None:
    svg = lines_as_svg(np.array([[1, 2, 330, 4]]))
    assert svg.startswith('<line x1="1" y1="2" x2="330" y2="4"/>') and svg.count("<circle") == 2
