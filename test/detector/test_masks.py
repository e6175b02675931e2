# SPDX-License-Identifier: Apache-2.0
"""Masks of segmentation heads: a disc in the prototypes comes back as that disc in the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.contract import Candidates
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams

from .discs import DISCS, MODEL_HW, NAMES, heads, instances, row_of, save_disc_model
from .tiny_model import save_constant_model

PICTURES = [(240, 320), (480, 640), (321, 211), (320, 320), (97, 533)]


def chosen(hw: tuple[int, int]) -> np.ndarray:
    """The first output where the model has chosen: x_min y_min x_max y_max, score, class, coefficients."""
    rows = np.zeros((1, 300, 38), np.float32)
    for k, (disc, number, score, label) in enumerate(zip(DISCS, (5, 31), (0.9, 0.8), (0, 2), strict=True)):
        cx, cy, w, h = row_of(hw, disc)
        corners = [cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2]
        rows[0, k] = [*corners, score, label, *(np.arange(32) == number)]
    return rows


def seen(path: Path, head: np.ndarray, hw: tuple[int, int], step: int = 4, contract: str = "auto") -> Detections:
    """What a model of this first output sees in a picture."""
    detector = Detector(DetectorParams(contract=contract), save_disc_model(path / "m.onnx", hw, head, step))
    return detector.detect(ColourImage(rgb=np.zeros((*hw, 3), np.uint8), stamp_ns=7))


def require_discs(hw: tuple[int, int], found: np.ndarray | None) -> None:
    assert found is not None and found.shape == hw and found.dtype == np.uint16
    expected, known = instances(hw)
    np.testing.assert_array_equal(found[known], expected[known])
    assert np.unique(expected[known]).tolist() == [0, 1, 2]


@pytest.mark.parametrize("hw", PICTURES)
@pytest.mark.parametrize("kind", ["yolov8", "yolov8 by row", "yolov5"])
def test_discs_come_back_at_their_pixels_through_the_letterbox(kind: str, hw: tuple[int, int], tmp_path: Path) -> None:
    found = seen(tmp_path, heads(hw, kind), hw)
    assert found.label == ("cup", "book")
    require_discs(hw, found.instances)


def test_a_head_that_has_chosen_already_gives_masks_too(tmp_path: Path) -> None:
    found = seen(tmp_path, chosen((240, 320)), (240, 320), contract="end_to_end")
    assert found.label == ("cup", "book")
    require_discs((240, 320), found.instances)


def test_prototypes_of_any_size_show_the_whole_picture_of_the_model(tmp_path: Path) -> None:
    hw = 240, 320
    require_discs(hw, seen(tmp_path, heads(hw, "yolov8"), hw, step=2).instances)


def test_a_mask_is_cut_to_its_box(tmp_path: Path) -> None:
    hw = 240, 320
    found = seen(tmp_path, heads(hw, "yolov8", margin=0.5), hw)
    for k in range(2):
        outside = np.ones(hw, bool)
        outside[found.touched(k)] = False
        assert (found.instances == k + 1).any() and not (found.instances == k + 1)[outside].any()


def test_a_picture_without_objects_has_an_empty_picture_of_masks(tmp_path: Path) -> None:
    found = seen(tmp_path, np.zeros_like(heads((240, 320), "yolov8")), (240, 320))
    assert len(found) == 0 and found.instances is not None and not found.instances.any()


def test_only_what_survives_the_suppression_of_overlaps_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []
    multiplied = np.tensordot
    monkeypatch.setattr(np, "tensordot", lambda a, b, axes: drawn.append(1) or multiplied(a, b, axes))
    hw = 240, 320
    head = heads(hw, "yolov8")
    head[0, :, 100:200] = head[0, :, 3:4]  # the cup a hundred times more
    assert len(seen(tmp_path, head, hw)) == 2 and len(drawn) == 2


def test_a_model_without_prototypes_gives_no_masks(tmp_path: Path) -> None:
    model = save_constant_model(tmp_path / "m.onnx", {"output0": heads((240, 320), "yolov8")[:, :7]},
                                (1, 3, *MODEL_HW), "images", 1, NAMES | {"task": "detect"})  # fmt: skip
    found = Detector(DetectorParams(), model).detect(ColourImage(rgb=np.zeros((240, 320, 3), np.uint8), stamp_ns=7))
    assert found.label == ("cup", "book") and found.instances is None


def test_candidates_are_boxes_unless_stated_otherwise() -> None:
    none = Candidates(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))
    assert none.coefficients is None and none.prototypes is None
