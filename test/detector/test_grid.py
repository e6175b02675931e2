# SPDX-License-Identifier: Apache-2.0
"""YOLOX and NanoDet: boxes relative to the cells of a grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.grid import cells, grid, strides_of
from objreg_ros.detector.params import DetectorParams

from .tiny_model import save_constant_model

LABELS = {"objreg.labels": '["cup", "pot", "book"]'}
HW = (64, 96)
IMAGE = ColourImage(rgb=np.zeros((240, 480, 3), np.uint8), stamp_ns=0)


def save(folder: Path, head: np.ndarray) -> Path:
    return save_constant_model(folder / "m.onnx", {"output": head}, (1, 3, *HW), "images", 1, LABELS)


def test_cells_run_along_rows_the_finest_grid_first() -> None:
    assert cells(HW, (8, 16, 32)) == 96 + 24 + 6 and cells((416, 416), (8, 16, 32, 64)) == 3598
    assert strides_of(126, HW) == (8, 16, 32) and strides_of(128, HW) == (8, 16, 32, 64) and strides_of(7, HW) is None
    cell = grid(HW, (8, 16, 32))
    assert cell[13].tolist() == [1, 1, 8] and cell[96].tolist() == [0, 0, 16] and cell[-1].tolist() == [2, 1, 32]


def test_a_box_of_yolox_is_counted_from_its_cell_and_its_picture_is_at_the_corner(tmp_path: Path) -> None:
    head = np.zeros((1, 126, 8), np.float32)
    head[0, 96 + 7] = [0.5, 0.25, np.log(2), np.log(1.5), 0.9, 0.1, 0.2, 1.0]  # the second of the second row of 16 px
    seen = Detector(DetectorParams(), save(tmp_path, head)).detect(IMAGE)  # 480 x 240 is 96 x 48 there
    centre, size = np.array([1.5, 1.25]) * 16 * 5, np.array([2, 1.5]) * 16 * 5
    assert seen.label == ("book",) and seen.score == pytest.approx([0.9])
    assert seen.xyxy[0] == pytest.approx([*centre - size / 2, *centre + size / 2], abs=1e-3)


def test_sides_of_nanodet_are_the_mean_of_their_bins(tmp_path: Path) -> None:
    head = np.zeros((1, 128, 3 + 32), np.float32)
    head[0, 13, 1] = 0.8
    bins = np.full((4, 8), -50.0)
    bins[0, 1] = bins[1, 0] = bins[2, 2] = bins[2, 3] = bins[3, 4] = 0  # 1, 0, 2.5 and 4 cells away
    head[0, 13, 3:] = bins.ravel()
    seen = Detector(DetectorParams(), save(tmp_path, head)).detect(IMAGE)
    expected = np.array([8 - 8, 8, 8 + 20, 8 + 32]) * [5, 240 / 64, 5, 240 / 64]
    assert seen.label == ("pot",) and seen.xyxy[0] == pytest.approx(expected, abs=1e-3)


def test_an_older_nanodet_and_a_decoded_yolox_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected NanoDet-Plus, \[1, 128, .* got \[1, 126, 35\]"):
        Detector(DetectorParams(contract="nanodet"), save(tmp_path, np.zeros((1, 126, 35))))
    with pytest.raises(ValueError, match=r"expected YOLOX's offsets .*decode_in_inference"):
        Detector(DetectorParams(), save(tmp_path, np.full((1, 126, 8), 60.0)))
    with pytest.raises(ValueError, match=r"expected a row for each cell of 96 x 64 pixels .* got 7"):
        Detector(DetectorParams(contract="yolox"), save(tmp_path, np.zeros((1, 7, 8))))
