# SPDX-License-Identifier: Apache-2.0
"""What counts as a mistake, and the picture that is made of it."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Detections
from training.augment import mosaic, window_at_the_middle
from training.labels import LABELS
from training.mistakes import CROP_HW, mistakes, window_around
from training.priors import INPUT_HW
from training.samples import Sample

BOOK, CAP = LABELS.index("book"), LABELS.index("cap")
AT = [100.0, 100.0, 200.0, 180.0]


def sample(label: int = BOOK, difficult: bool = False) -> Sample:
    return Sample(
        np.zeros((480, 640, 3), np.uint8), np.array([AT], np.float32), np.array([label]), np.array([difficult])
    )


def seen(*found: tuple[str, float, list[float]]) -> Detections:
    return Detections(
        label=tuple(label for label, _, _ in found),
        score=np.array([score for _, score, _ in found], np.float32),
        xyxy=np.array([box for _, _, box in found], np.float32).reshape(-1, 4),
        image_hw=(480, 640),
        stamp_ns=0,
    )


@pytest.mark.parametrize("found", [[], [("book", 0.4, AT)], [("book", 0.9, [100.0, 100.0, 130.0, 180.0])]])
def test_an_object_without_a_good_box_of_a_good_score_is_missed(found: list[tuple[str, float, list[float]]]) -> None:
    assert AT in mistakes(sample(), seen(*found)).tolist()


def test_a_thing_that_is_well_found_is_no_mistake() -> None:
    assert len(mistakes(sample(), seen(("book", 0.8, AT)))) == 0


def test_what_need_not_be_found_may_be_found() -> None:
    assert len(mistakes(sample(difficult=True), seen())) == 0
    assert len(mistakes(sample(difficult=True), seen(("cap", 0.9, AT)))) == 0


def test_a_box_at_nothing_and_a_box_of_the_wrong_label_are_mistakes() -> None:
    elsewhere = [400.0, 300.0, 460.0, 360.0]
    wrong = mistakes(sample(), seen(("book", 0.8, AT), ("cap", 0.3, elsewhere), ("cap", 0.3, AT), ("cap", 0.1, AT)))
    assert wrong.tolist() == [elsewhere, AT]


def test_the_crop_holds_the_mistake_in_its_middle_at_its_size_or_smaller() -> None:
    small, large = window_around(np.array(AT)), window_around(np.array([0.0, 0.0, 400.0, 100.0]))
    assert small.tolist() == [150 - CROP_HW[1] / 2, 140 - CROP_HW[0] / 2, 150 + CROP_HW[1] / 2, 140 + CROP_HW[0] / 2]
    assert large[0] == 200 - 320 and large[2] == 200 + 320 and (large[1] + large[3]) / 2 == 50


def test_every_piece_of_a_mosaic_of_mistakes_shows_the_middle_of_its_crop() -> None:
    rgb = np.zeros((*CROP_HW, 3), np.uint8)
    rgb[80:112, 108:148] = 255
    crop = Sample(rgb, np.array([[108, 80, 148, 112]], np.float32), np.array([CAP]), np.array([False]))
    picture = mosaic(lambda: crop, np.random.default_rng(1), (3,), window_at_the_middle)
    assert picture.rgb.shape == (*INPUT_HW, 3) and len(picture.boxes) == 9 and not picture.difficult.any()
    for x0, y0, x1, y1 in picture.boxes.round().astype(int):
        assert (picture.rgb[y0 + 3 : y1 - 3, x0 + 3 : x1 - 3] > 200).all()
