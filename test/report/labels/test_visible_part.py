# SPDX-License-Identifier: Apache-2.0
"""What is seen of a square before a wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import pose
from objreg_tools.report.labels.visible_part import VisiblePart, visible_part
from report.labels.scene import BOX, NEAR, WALL, seen, square


def part_of(image: DepthImage, T_map_camera: np.ndarray | None = None) -> VisiblePart:
    part = visible_part(square(), image, np.eye(4) if T_map_camera is None else T_map_camera)
    assert part is not None
    return part


def with_depth(x_min: int, x_max: int, metres: float) -> DepthImage:
    image = seen()
    depth = image.depth.copy()
    depth[:, x_min:x_max] = metres
    return replace(image, depth=depth)


def test_what_nothing_is_before_is_seen_whole_in_its_box() -> None:
    part = part_of(seen())
    assert part.xyxy == pytest.approx(BOX, abs=1)
    assert part.pixels == pytest.approx(3600, rel=0.05) and part.share == pytest.approx(1.0, abs=0.05)


def test_of_what_is_half_hidden_the_box_is_that_of_the_rest() -> None:
    part = part_of(with_depth(0, 160, 0.6))
    assert part.xyxy == pytest.approx((160, 90, 190, 150), abs=1) and part.share == pytest.approx(0.5, abs=0.05)


def test_what_is_wholly_hidden_or_no_longer_there_is_not_seen() -> None:
    assert visible_part(square(), with_depth(0, 320, 0.6), np.eye(4)) is None
    assert visible_part(square(), seen(shown=False), np.eye(4)) is None


def test_a_small_gap_in_the_depth_hides_nothing_but_a_picture_without_depth_shows_nothing() -> None:
    assert part_of(with_depth(158, 164, 0.0)).share == pytest.approx(1.0, abs=0.05)
    assert visible_part(square(), with_depth(0, 320, 0.0), np.eye(4)) is None


def test_a_side_of_the_picture_without_depth_hides_nothing_where_most_is_measured() -> None:
    part = part_of(with_depth(170, 320, 0.0))  # a third of the square
    assert part.xyxy == pytest.approx(BOX, abs=1) and part.share == pytest.approx(1.0, abs=0.05)
    assert visible_part(square(), with_depth(145, 320, 0.0), np.eye(4)) is None


def test_what_is_not_measured_behind_something_is_not_taken_for_seen() -> None:
    image = with_depth(0, 150, 0.6)
    depth = image.depth.copy()
    depth[:, 170:] = 0.0
    part = part_of(replace(image, depth=depth))
    assert part.xyxy == pytest.approx((150, 90, 175, 150), abs=1)


def test_what_leaves_the_picture_is_seen_in_part() -> None:
    aside = square(at=(160 / 300, 0.0))  # its middle is upon the right border
    image = seen(shown=False)
    depth = np.full_like(image.depth, WALL)
    depth[90:150, 290:] = NEAR
    part = visible_part(aside, replace(image, depth=depth), np.eye(4))
    assert part is not None and part.xyxy == pytest.approx((290, 90, 320, 150), abs=1)
    assert part.share == pytest.approx(0.5, abs=0.05)


def test_a_camera_that_moved_sees_it_elsewhere() -> None:
    image = seen(shown=False)
    depth = np.full_like(image.depth, WALL)
    depth[90:150, 100:160] = NEAR
    moved = pose(np.eye(3), np.array([0.1, 0.0, 0.0]))  # 30 px
    part = visible_part(square(), replace(image, depth=depth), moved)
    assert part is not None and part.xyxy == pytest.approx((100, 90, 160, 150), abs=1)


def test_its_back_is_not_seen_from_before() -> None:
    one = square()
    away = replace(one, views=tuple(replace(view, normals=-view.normals) for view in one.views))
    assert visible_part(away, seen(), np.eye(4)) is None
