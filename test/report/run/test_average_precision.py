# SPDX-License-Identifier: Apache-2.0
"""Average precision against curves worked out by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from objreg_ros.data.images import Detections
from objreg_tools.report.run.average_precision import TrueBoxes, average_precision

A, B, FAR = (0, 0, 10, 10), (20, 0, 30, 10), (50, 50, 60, 60)


def seen(*boxes: tuple[Sequence[float], float], label: str = "cap") -> Detections:
    return Detections(
        xyxy=np.array([box for box, _ in boxes], np.float32).reshape(-1, 4),
        score=np.array([score for _, score in boxes], np.float32),
        label=(label,) * len(boxes),
        image_hw=(100, 100),
        stamp_ns=0,
    )


def known(*boxes: Sequence[float], difficult: Sequence[bool] | None = None) -> TrueBoxes:
    hard = np.array(difficult if difficult is not None else [False] * len(boxes), bool)
    return TrueBoxes(np.array(boxes, np.float32).reshape(-1, 4), ("cap",) * len(boxes), hard)


def test_everything_found_and_nothing_else_is_one() -> None:
    assert average_precision([seen((A, 0.9), (B, 0.8))], [known(A, B)], "cap") == 1.0


def test_a_false_box_between_two_right_ones_costs_precision_at_full_recall() -> None:
    one = [seen((A, 0.9), (FAR, 0.8), (B, 0.7))]
    assert average_precision(one, [known(A, B)], "cap") == pytest.approx(0.5 * 1 + 0.5 * 2 / 3)


def test_precision_is_interpolated_from_the_right() -> None:
    one = [seen((FAR, 0.9), (A, 0.8), (B, 0.7))]
    assert average_precision(one, [known(A, B)], "cap") == pytest.approx(2 / 3)


def test_what_is_missed_is_lost_recall() -> None:
    assert average_precision([seen((A, 0.9)), seen()], [known(A), known(A)], "cap") == pytest.approx(0.5)
    assert average_precision([seen()], [known(A)], "cap") == 0.0


def test_without_any_image_there_is_nothing_to_be_found() -> None:
    assert average_precision([], [], "cap") is None


def test_a_second_box_on_the_same_object_is_wrong() -> None:
    one = [seen((A, 0.9), ((0, 0, 10, 9), 0.8), (B, 0.7))]
    assert average_precision(one, [known(A, B)], "cap") == pytest.approx(0.5 + 0.5 * 2 / 3)


def test_a_difficult_box_counts_neither_when_found_nor_when_missed() -> None:
    truth = [known(A, B, difficult=[False, True])]
    assert average_precision([seen((B, 0.95), (A, 0.9))], truth, "cap") == 1.0
    assert average_precision([seen((A, 0.9))], truth, "cap") == 1.0


def test_half_an_overlap_is_just_enough() -> None:
    assert average_precision([seen(((0, 0, 10, 5), 0.9))], [known(A)], "cap") == 1.0
    assert average_precision([seen(((0, 0, 10, 4.9), 0.9))], [known(A)], "cap") == 0.0


def test_another_label_on_the_right_place_is_wrong() -> None:
    assert average_precision([seen((A, 0.9), label="bowl")], [known(A)], "cap") == 0.0
    assert average_precision([seen((A, 0.9), label="bowl")], [known(A)], "bowl") is None


def test_scores_are_ranked_over_all_images_together() -> None:
    images = [seen((FAR, 0.9)), seen((A, 0.8))]
    assert average_precision(images, [known(), known(A)], "cap") == pytest.approx(0.5)


def test_a_false_alarm_smaller_than_what_is_asked_for_is_no_error() -> None:
    one = [seen(((50, 50, 54, 54), 0.95), (A, 0.9))]
    assert average_precision(one, [known(A)], "cap") == pytest.approx(0.5)
    assert average_precision(one, [known(A)], "cap", least_area=20.0) == 1.0
