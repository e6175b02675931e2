# SPDX-License-Identifier: Apache-2.0
"""The outline of an object is where its points are in the picture."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.offline.outlines import field_of_view_deg, outline

CAMERA = Intrinsics(fx=160.0, fy=160.0, cx=160.0, cy=120.0, width=320, height=240)


def corners(text: str) -> set[tuple[int, int]]:
    return {(int(u), int(v)) for u, v in (corner.split(",") for corner in text.split())}


def test_a_square_has_four_corners_in_thousandths_of_the_width() -> None:
    side = np.linspace(-0.5, 0.5, 9)
    xyz = np.array([(x, y, 2.0) for x in side for y in side], np.float32)
    assert corners(outline(xyz, CAMERA)) == {(375, 250), (625, 250), (625, 500), (375, 500)}


def test_it_is_the_same_for_a_picture_of_another_size() -> None:
    xyz = np.random.default_rng(0).uniform((-0.4, -0.4, 1.0), (0.4, 0.4, 1.2), (200, 3)).astype(np.float32)
    half = Intrinsics(fx=80.0, fy=80.0, cx=80.0, cy=60.0, width=160, height=120)
    assert outline(xyz, CAMERA) == outline(xyz, half)


def test_it_stays_in_the_picture_and_few_points_have_none() -> None:
    wide = np.array([(-9, -9, 1.0), (9, -9, 1.0), (9, 9, 1.0), (-9, 9, 1.0)], np.float32)
    assert all(0 <= u < 1000 and 0 <= v < 750 for u, v in corners(outline(wide, CAMERA)))
    assert outline(wide[:2], CAMERA) == "" and outline(np.zeros((0, 3), np.float32), CAMERA) == ""
    assert outline(wide * (1, 1, -1), CAMERA) == "", "behind the camera"


def test_the_field_of_view_is_that_of_the_whole_picture() -> None:
    assert field_of_view_deg(CAMERA) == (90.0, pytest.approx(73.7, abs=0.05))
