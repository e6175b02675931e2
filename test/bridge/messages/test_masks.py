# SPDX-License-Identifier: Apache-2.0
"""The column of masks in a table of detections: what it brings back, and what is refused before memory is taken."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from bridge import sample_messages as messages
from objreg_ros import limits
from objreg_ros.bridge.messages import from_msg
from objreg_ros.bridge.messages.layout import DETECTIONS, MASK
from objreg_ros.bridge.messages.masks import read_masks, with_masks
from objreg_ros.data.images import Detections

HW = 60, 80
XYXY = [[10.4, 5.5, 30.0, 20.2], [20, 10, 60, 50], [90, 70, 99, 80]]  # the last one lies outside


def found(instances: np.ndarray | None, count: int = 3) -> Detections:
    return Detections(xyxy=np.array(XYXY[:count], np.float32).reshape(-1, 4), instances=instances,
                      score=np.linspace(0.9, 0.1, count, dtype=np.float32), label=("cup",) * count,
                      image_hw=HW, stamp_ns=5)  # fmt: skip


def some_masks() -> np.ndarray:
    """Every pixel that a box touches is of either, at random."""
    inside = np.zeros(HW, bool)
    inside[5:21, 10:30] = inside[10:50, 20:60] = True
    numbers = np.zeros(HW, np.uint16)
    first = np.random.default_rng(3).random(HW) < 0.5
    numbers[10:50, 20:60] = 2
    numbers[5:21, 10:30][first[5:21, 10:30]] = 1
    return numbers


def table(of: Detections) -> np.ndarray:
    rows = np.zeros((1, len(of)), DETECTIONS)
    rows["score"], rows["image_height"], rows["image_width"] = of.score, *HW
    for axis, name in enumerate(("x_min", "y_min", "x_max", "y_max")):
        rows[name] = of.xyxy[:, axis]
    return rows


def read(rows: np.ndarray, **more: Any) -> Detections:
    return from_msg.detections(messages.own_table(rows, **more), {0: "cup"}, HW)


def test_masks_come_back_to_the_pixel_and_a_box_outside_has_none() -> None:
    rows = with_masks(table(found(None)), found(some_masks()))
    assert rows.dtype.names == (*(DETECTIONS.names or ()), MASK)
    np.testing.assert_array_equal(read(rows).instances, some_masks())


def test_rows_in_another_order_bring_their_masks_along() -> None:
    rows = with_masks(table(found(None)), found(some_masks()))
    np.testing.assert_array_equal(read(rows[:, ::-1]).instances, some_masks())


def test_masks_of_half_the_size_are_given_in_that_of_the_picture() -> None:
    half = np.zeros((30, 40), np.uint16)
    half[6:20, 12:28] = 2
    instances = read(with_masks(table(found(None)), found(half))).instances
    assert instances is not None and (instances == 2).sum() == 28 * 32 and (instances[12:40, 24:56] == 2).all()


@pytest.mark.parametrize("of", [found(None), found(some_masks(), 0)])
def test_a_table_without_masks_stays_as_it_was(of: Detections) -> None:
    rows = with_masks(table(of), of)
    assert rows.dtype == DETECTIONS and read(rows).instances is None


def test_masks_that_no_record_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_RECORD", 100)
    with pytest.raises(ValueError, match=r"expected masks of at most 74 bytes as PNG, got \d+"):
        with_masks(table(found(None)), found(some_masks()))


def with_column(column: np.ndarray) -> np.ndarray:
    rows = np.zeros((1, 1), [*DETECTIONS.descr, (MASK, column.dtype.str, column.shape)])
    for name, value in zip(DETECTIONS.names or (), table(found(None, 1))[0, 0].item(), strict=True):
        rows[name] = value
    rows[MASK][0, 0] = column
    return rows


def png(height: int, width: int) -> np.ndarray:
    return np.asarray(cv2.imencode(".png", np.ones((height, width), np.uint8))[1]).ravel()


HOSTILE = [
    (png(16, 21), r"expected a PNG of the size of its box, \[16, 20\], got \[16, 21\]|at most 320 pixels"),
    (png(20, 16), r"expected a PNG of the size of its box, \[16, 20\], got \[20, 16\]"),
    (png(3000, 3000), "at most 320 pixels"),
    (png(16, 20)[:-30], "expected a png of|do not decode"),
    (np.zeros(100, np.uint8), "expected png, got 100 bytes that do not begin so"),
    (np.zeros(100, np.float32), r"expected several uint8 for each box, got float32 of shape \(1, 100\)"),
]


@pytest.mark.parametrize(("column", "message"), HOSTILE)
def test_what_is_no_mask_of_its_box_is_refused(column: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read(with_column(column))


def test_a_picture_beyond_all_measure_is_refused_before_memory_is_taken() -> None:
    rows = with_column(png(16, 20))
    rows["image_height"], rows["image_width"] = 60000, 60000
    with pytest.raises(ValueError, match="expected a picture of at most 50000000 pixels, got 60000 x 60000"):
        read(rows)


def test_masks_are_read_into_the_numbers_of_their_boxes() -> None:
    rows = with_masks(table(found(None)), found(some_masks()))
    np.testing.assert_array_equal(read_masks(rows.reshape(-1), found(None)), some_masks())
