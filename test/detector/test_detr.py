# SPDX-License-Identifier: Apache-2.0
"""RT-DETR and D-FINE in their three exports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams

from .tiny_model import centred, save_constant_model, save_seeing_model

LABELS = {"objreg.labels": '["cup", "pot", "book"]'}
IMAGE = ColourImage(rgb=np.zeros((240, 480, 3), np.uint8), stamp_ns=0)


def test_boxes_are_of_the_size_that_the_second_input_says(tmp_path: Path) -> None:
    outputs = {"labels": np.array([[1, 0]]), "boxes": np.array([[[0.25, 0.5, 0.5, 1.0], [0, 0, 1, 1]]]),
               "scores": np.array([[0.9, 0.2]])}  # fmt: skip
    path = save_constant_model(tmp_path / "m.onnx", outputs, (1, 3, 64, 96), "images", 1, LABELS, sizes=True)
    seen = Detector(DetectorParams(), path).detect(IMAGE)
    assert seen.label == ("pot",) and seen.xyxy[0] == pytest.approx([120, 120, 240, 240])


def test_queries_of_hugging_face_are_logits_and_shares(tmp_path: Path) -> None:
    outputs = {"logits": np.array([[[-9, 2, -9], [-9, -9, -9]]]), "pred_boxes": np.array([[[0.5, 0.5, 0.2, 0.4]] * 2])}
    path = save_constant_model(tmp_path / "m.onnx", outputs, (1, 3, 64, 96), "pixel_values", 1, LABELS)
    seen = Detector(DetectorParams(), path).detect(IMAGE)
    assert seen.label == ("pot",) and seen.score == pytest.approx([1 / (1 + np.exp(-2))])
    assert seen.xyxy[0] == pytest.approx([192, 72, 288, 168])


def test_a_class_for_nothing_is_refused(tmp_path: Path) -> None:
    outputs = {"logits": np.zeros((1, 2, 4)), "pred_boxes": np.zeros((1, 2, 4))}
    path = save_constant_model(tmp_path / "m.onnx", outputs, (1, 3, 64, 96), "pixel_values", 1, LABELS)
    with pytest.raises(ValueError, match=r"expected logits .* for 3 labels, got logits \[1, 2, 4\]"):
        Detector(DetectorParams(), path)


def test_rows_of_ultralytics_are_shares_of_a_stretched_picture(tmp_path: Path) -> None:
    metadata = LABELS | {"description": "Ultralytics rtdetr-l model", "stride": "32", "task": "detect"}
    path = save_seeing_model(tmp_path / "m.onnx", centred(0.1, 0.9, 0.1, width=480, height=320), (320, 480), (1, 1, 7),
                             metadata=metadata)  # fmt: skip
    rgb = np.zeros((240, 480, 3), np.uint8)
    rgb[30:90, 60:200] = 255
    seen = Detector(DetectorParams(), path).detect(ColourImage(rgb=rgb, stamp_ns=0))
    assert seen.label == ("pot",) and seen.xyxy[0] == pytest.approx([60, 30, 200, 90], abs=0.8)
