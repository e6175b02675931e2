# SPDX-License-Identifier: Apache-2.0
"""Boxes in pixels of the depth image."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.images import Detections
from objreg_ros.segmenter.objects.boxes import halves, is_empty, pixel_boxes


def boxes(*xyxy: tuple[float, ...]) -> list[tuple[int, int, int, int]]:
    n = len(xyxy)
    asked = Detections(
        xyxy=np.array(xyxy, np.float32), score=np.ones(n, np.float32), label=("",) * n, image_hw=(480, 640), stamp_ns=0
    )
    return pixel_boxes(asked, 240, 320)


def test_boxes_are_scaled_and_only_whole_pixels_count() -> None:
    assert boxes((10, 20, 101, 203)) == [(5, 10, 50, 101)]


def test_boxes_are_clipped_to_the_image_and_those_outside_are_empty() -> None:
    inside, outside = boxes((-50, -50, 9999, 9999), (700, 10, 900, 90))
    assert inside == (0, 0, 320, 240)
    assert is_empty(outside)


def test_boxes_are_halved_by_their_pixels_and_empty_ones_left_out() -> None:
    large, small, empty = (0, 0, 40, 30), (0, 0, 20, 30), (5, 5, 5, 9)
    first, second = halves([small, large, empty, small])
    assert sorted(first + second) == [0, 1, 3]
    assert first == [1]


def test_a_lone_box_leaves_nothing_for_the_other_half() -> None:
    assert halves([(0, 0, 40, 30)]) == ([0], [])
