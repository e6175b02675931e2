# SPDX-License-Identifier: Apache-2.0
"""Boxes must follow what happens to the picture."""

from __future__ import annotations

import numpy as np
import pytest

from training.augment import LABEL_WEIGHTS, augment, cut, flip, mosaic, window_at_an_object
from training.labels import LABELS
from training.priors import INPUT_HW
from training.samples import Sample

RED = (255, 0, 0)


def one_red_box() -> Sample:
    rgb = np.zeros((240, 320, 3), np.uint8)
    rgb[60:120, 100:180] = RED
    return Sample(rgb, np.array([[100, 60, 180, 120]], np.float32), np.array([3]), np.array([False]))


def red_extent(rgb: np.ndarray) -> np.ndarray:
    """The box around what is more red than not."""
    rows, columns = np.nonzero((rgb[..., 0] > 127) & (rgb[..., 1] < 60) & (rgb[..., 2] < 60))
    return np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])


def test_the_mirrored_box_is_around_the_mirrored_object() -> None:
    mirrored = flip(one_red_box())
    assert mirrored.boxes[0].tolist() == red_extent(mirrored.rgb).tolist() == [140, 60, 220, 120]


@pytest.mark.parametrize("window", [[80, 40, 240, 160], [50, 20, 290, 220], [-100, -50, 400, 330]])
def test_the_box_follows_a_cut(window: list[float]) -> None:
    rng = np.random.default_rng(1)
    part = cut(one_red_box(), np.array(window, float), INPUT_HW, rng)
    inside = part.rgb.copy()
    inside[:, : int(part.boxes[0, 0]) - 6] = 0  # the filling beside the picture may be red too
    inside[:, int(part.boxes[0, 2]) + 6 :] = 0
    inside[: int(part.boxes[0, 1]) - 6] = 0
    inside[int(part.boxes[0, 3]) + 6 :] = 0
    assert part.boxes[0] == pytest.approx(red_extent(inside), abs=2)


def test_what_a_cut_leaves_little_of_is_difficult_and_what_is_gone_is_gone() -> None:
    rng = np.random.default_rng(1)
    little = cut(one_red_box(), np.array([160, 60, 320, 180], float), INPUT_HW, rng)
    assert little.difficult.tolist() == [True]
    assert len(cut(one_red_box(), np.array([200, 60, 320, 150], float), INPUT_HW, rng).boxes) == 0


def test_a_window_at_an_object_holds_the_object() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        low_x, low_y, high_x, high_y = window_at_an_object(one_red_box(), (80, 106), rng)
        assert low_x <= 100 and low_y <= 60 and high_x >= 180 and high_y >= 120


def test_a_mosaic_shows_every_piece_at_its_place() -> None:
    rng = np.random.default_rng(3)
    picture = mosaic(one_red_box, rng)
    assert len(picture.boxes) in (4, 9, 16, 25)
    for x0, y0, x1, y1 in picture.boxes.round().astype(int):
        assert (picture.rgb[y0 + 2 : y1 - 2, x0 + 2 : x1 - 2, 0] > 150).all()


def test_augmented_pictures_have_the_networks_size_and_boxes_inside() -> None:
    rng = np.random.default_rng(4)
    for _ in range(30):
        sample = augment(one_red_box, rng)
        assert sample.rgb.shape == (*INPUT_HW, 3) and sample.rgb.dtype == np.uint8
        assert (sample.boxes >= 0).all() and (sample.boxes <= np.array(INPUT_HW[::-1] * 2)).all()
        assert (sample.boxes[:, 2:] > sample.boxes[:, :2]).all()


def test_every_label_has_a_weight() -> None:
    assert len(LABEL_WEIGHTS) == len(LABELS)
