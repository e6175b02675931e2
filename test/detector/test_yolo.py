# SPDX-License-Identifier: Apache-2.0
"""YOLO's heads, by networks that find a bright rectangle in their picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams

from .tiny_model import centred, save_constant_model, save_seeing_model

NAMES = {"names": "{0: 'cup', 1: 'pot', 2: 'book'}", "stride": "32", "task": "detect"}
V8 = centred(0.1, 0.2, 0.9)
V5 = np.insert(centred(0.1, 1.0, 0.1), 4, [0, 0, 0, 0, 0.8], axis=1)
CHOSEN = np.hstack([np.eye(5, 4), [[0, 0]] * 4 + [[0.7, 1]]])
WHERE = [60, 30, 200, 90]


def bright(height: int = 120, width: int = 300) -> ColourImage:
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[WHERE[1] : WHERE[3], WHERE[0] : WHERE[2]] = 255
    return ColourImage(rgb=rgb, stamp_ns=0)


HEADS = [
    (V8, (1, 7, 1), "book", 0.9),
    (V8, (1, 1, 7), "book", 0.9),
    (V5, (1, 1, 8), "pot", 0.8),
    (CHOSEN, (1, 1, 6), "pot", 0.7),
]


@pytest.mark.parametrize(("matrix", "shape", "label", "score"), HEADS)
@pytest.mark.parametrize("size", [(120, 300), (300, 210), (240, 240)])
def test_a_rectangle_comes_back_at_its_pixels_through_the_letterbox(
    matrix: np.ndarray, shape: tuple[int, ...], label: str, score: float, size: tuple[int, int], tmp_path: Path
) -> None:
    one = Detector(DetectorParams(), save_seeing_model(tmp_path / "m.onnx", matrix, (640, 480), shape, metadata=NAMES))
    seen = one.detect(bright(*size))
    assert seen.label == (label,) and seen.score == pytest.approx([score])
    assert seen.xyxy[0] == pytest.approx(WHERE, abs=0.7)


@pytest.mark.parametrize(("matrix", "shape", "label", "score"), [*HEADS[:1], *HEADS[2:]])
def test_the_boxes_of_a_segmentation_head_are_used(
    matrix: np.ndarray, shape: tuple[int, ...], label: str, score: float, tmp_path: Path
) -> None:
    matrix = np.hstack([matrix, np.tile([[0.0]] * 4 + [[9.0]], (1, 32))])
    shape = tuple(side if side == 1 else side + 32 for side in shape)
    path = save_seeing_model(tmp_path / "m.onnx", matrix, (640, 480), shape, {"output1": np.zeros((1, 32, 160, 120))},
                             metadata=NAMES | {"task": "segment"})  # fmt: skip
    seen = Detector(DetectorParams(), path).detect(bright())
    assert seen.label == (label,) and seen.xyxy[0] == pytest.approx(WHERE, abs=0.7)


def test_a_model_of_open_input_size_is_given_that_of_its_metadata(tmp_path: Path) -> None:
    head = np.zeros((1, 7, 10), np.float32)
    head[0, :, 4] = [100, 160, 40, 80, 0, 0.9, 0]
    path = save_constant_model(tmp_path / "m.onnx", {"output0": head}, (1, 3, "height", "width"), "images", 1,
                               NAMES | {"imgsz": "[320, 320]"})  # fmt: skip
    seen = Detector(DetectorParams(), path).detect(ColourImage(rgb=np.zeros((480, 640, 3), np.uint8), stamp_ns=0))
    assert seen.xyxy[0] == pytest.approx([160, 160, 240, 320]) and seen.label == ("pot",)


def test_a_class_without_a_label_is_refused(tmp_path: Path) -> None:
    path = save_seeing_model(tmp_path / "m.onnx", CHOSEN, (640, 480), (1, 1, 6), metadata=NAMES | {"names": "['cup']"})
    with pytest.raises(ValueError, match=r"expected one of 1 labels, got number 1"):
        Detector(DetectorParams(contract="end_to_end"), path).detect(bright())
