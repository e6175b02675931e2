# SPDX-License-Identifier: Apache-2.0
"""The detector as a whole: tiny models with known answers, and the COCO model on real pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.detector.picture import USUAL_HW
from objreg_ros.detector.runtime import Runtime

from .tiny_model import TF_API, onnx, raw_metadata, save_constant_model, tf_outputs

BOX = [0.25, 0.1, 0.75, 0.6]


def picture(height: int = 480, width: int = 640) -> ColourImage:
    return ColourImage(rgb=np.zeros((height, width, 3), np.uint8), stamp_ns=5, frame_id="kinect")


def detector(folder: Path, boxes: Any, classes: Any, scores: Any, model: dict[str, Any] | None = None, **params: Any):
    path = save_constant_model(folder / "m.onnx", tf_outputs(boxes, classes, scores), **(model or {}))
    (folder / "m.txt").write_text("???\nbook\nperson\nbowl\n???\n")
    return Detector(DetectorParams(**params), path)


def test_a_box_comes_back_in_pixels_with_its_name_and_the_stamp_of_the_image(tmp_path: Path) -> None:
    seen = detector(tmp_path, [BOX], [2], [0.8]).detect(picture())
    assert seen.xyxy.tolist() == [pytest.approx([64, 120, 384, 360])]
    assert seen.label == ("bowl",) and seen.score == pytest.approx([0.8])
    assert (seen.stamp_ns, seen.frame_id, seen.image_hw) == (5, "kinect", (480, 640))


def test_the_model_and_the_labels_that_the_parameters_name_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    detector(tmp_path, [BOX], [2], [0.8])
    (tmp_path / "mine.txt").write_text("cup\ntv\nhome\n")
    monkeypatch.setenv("HOME", str(tmp_path))
    made = Detector.of(DetectorParams(model="m.onnx", labels="~/mine.txt"), lambda name: tmp_path / name)
    assert made.detect(picture()).label == ("home",)


def test_nothing_above_the_threshold_gives_no_detection(tmp_path: Path) -> None:
    seen = detector(tmp_path, [BOX], [2], [0.8], threshold=0.81).detect(picture())
    assert len(seen) == 0 and seen.xyxy.shape == (0, 4)


def test_detections_come_best_first_and_overlaps_of_one_label_are_suppressed(tmp_path: Path) -> None:
    shifted = [0.26, 0.1, 0.76, 0.6]
    seen = detector(tmp_path, [BOX, shifted, [0, 0.7, 0.2, 0.9]], [2, 2, 0], [0.6, 0.9, 0.7]).detect(picture())
    assert seen.label == ("bowl", "book") and seen.score == pytest.approx([0.9, 0.7])


def test_ignored_and_unnamed_labels_do_not_go_on(tmp_path: Path) -> None:
    seen = detector(
        tmp_path, [BOX, [0, 0, 0.2, 0.2], [0, 0.7, 0.2, 1]], [1, 3, 0], [0.9, 0.9, 0.8], ignore=("person",)
    ).detect(picture())
    assert seen.label == ("book",)


def test_boxes_are_cut_to_the_image_and_too_small_or_too_large_ones_go(tmp_path: Path) -> None:
    boxes = [[-0.5, -0.5, 0.5, 0.5], [0.6, 0.6, 0.61, 0.9], [0, 0, 1, 1], [2, 2, 3, 3]]
    seen = detector(tmp_path, boxes, [0, 2, 2, 2], [0.9, 0.9, 0.8, 0.7], max_area=0.5).detect(picture())
    assert seen.xyxy.tolist() == [[0, 0, 320, 240]]


def test_the_number_of_detections_is_limited_to_the_best(tmp_path: Path) -> None:
    boxes = [[0, x, 0.1, x + 0.1] for x in (0, 0.3, 0.6)]
    seen = detector(tmp_path, boxes, [0, 0, 0], [0.6, 0.9, 0.7], max_detections=2).detect(picture())
    assert seen.score == pytest.approx([0.9, 0.7])


def test_a_box_that_is_not_finite_is_no_detection(tmp_path: Path) -> None:
    assert len(detector(tmp_path, [[np.nan, 0, 1, 1]], [0], [0.9]).detect(picture())) == 0


def test_a_model_of_open_input_size_sees_pictures_of_any_size(tmp_path: Path) -> None:
    one = detector(tmp_path, [BOX], [2], [0.8], model={"input_shape": (1, "h", "w", 3), "input_name": "image_tensor:0"},
                   label_offset="0")  # fmt: skip
    assert one.detect(picture(100, 200)).xyxy[0] == pytest.approx([20, 25, 120, 75])
    assert one.detect(picture(50, 60)).image_hw == (50, 60)


def test_an_image_without_pixels_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected at least one pixel, got 640 x 0"):
        detector(tmp_path, [BOX], [2], [0.8]).detect(picture(height=0))


def test_raw_heads_with_priors_in_the_metadata_detect(tmp_path: Path) -> None:
    priors = np.array([[0.5, 0.5, 0.2, 0.4], [0.2, 0.2, 0.1, 0.1]], np.float32)
    heads = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 0, 6], [6, 0, 0]]], float)}
    path = save_constant_model(tmp_path / "raw.onnx", heads, metadata=raw_metadata(priors, ["cap", "soda can"]))
    one = Detector(DetectorParams(), path)
    seen = one.detect(picture())
    assert one.labels == ("cap", "soda can") and seen.label == ("soda can",)
    assert seen.xyxy[0] == pytest.approx([256, 144, 384, 336], abs=1e-3)


def test_raw_heads_of_open_input_size_always_see_pictures_of_the_size_of_their_priors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heads = {"loc": np.zeros((1, 1, 4)), "logits": np.array([[[0, 6]]], float)}
    metadata = raw_metadata(np.array([[0.75, 0.75, 0.1, 0.1]], np.float32), ["cap"])
    path = save_constant_model(tmp_path / "raw.onnx", heads, (1, "h", "w", 3), metadata=metadata)
    shapes, run = [], Runtime.run
    monkeypatch.setattr(
        Runtime, "run", lambda self, tensor, *rest: shapes.append(tensor.shape) or run(self, tensor, *rest)
    )
    one = Detector(DetectorParams(), path)
    small = ColourImage(rgb=np.zeros((240, 320, 3), np.uint8), stamp_ns=0)
    assert one.detect(small).xyxy[0] == pytest.approx([224, 168, 256, 192], abs=1e-3)
    assert set(shapes) == {(1, *USUAL_HW, 3)}


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ({"input_shape": (1, 30, 40)}, "expected one input, uint8"),
        ({"dtype": onnx.TensorProto.INT64}, "expected one input, uint8"),
    ],
)
def test_a_model_of_another_shape_is_refused_at_construction(model: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        detector(tmp_path, [BOX], [2], [0.8], model=model)


def test_a_model_without_scores_is_refused_at_construction(tmp_path: Path) -> None:
    outputs = {name: value for name, value in tf_outputs([BOX], [1], [0.9], TF_API).items() if "scores" not in name}
    path = save_constant_model(tmp_path / "m.onnx", outputs, metadata={"objreg.labels": '["a"]'})
    with pytest.raises(ValueError, match=r"expected boxes .*got detection_boxes"):
        Detector(DetectorParams(), path)


def test_the_coco_model_finds_the_desk_on_real_pictures(shared: Path) -> None:
    model = shared / "models" / "ssd_mobilenet_v1_coco_int8.onnx"
    if not model.is_file():
        pytest.skip(f"no model at {model}")
    one = Detector(DetectorParams(threshold=0.4), model)
    found: set[str] = set()
    for path in sorted((shared / "data" / "fr2_desk_rgb").glob("*.jpg")):
        rgb = np.ascontiguousarray(cv2.imread(str(path))[..., ::-1])
        found |= set(one.detect(ColourImage(rgb=rgb, stamp_ns=0)).label)
    assert len(one.labels) == 90
    assert {"tv", "keyboard", "mouse", "book", "chair", "cup"} <= found
