# SPDX-License-Identifier: Apache-2.0
"""Masks of segmentation heads: a disc in the prototypes comes back as that disc in the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data import ColourImage, Detections
from objreg_ros.detector.contract import Candidates
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.detector.picture import Place

from .tiny_model import save_constant_model

MODEL_HW = 320, 320
NAMES = {"names": "{0: 'cup', 1: 'pot', 2: 'book'}", "stride": "32", "task": "segment"}
PICTURES = [(240, 320), (480, 640), (321, 211), (320, 320), (97, 533)]
Disc = tuple[float, float, float]  # x, y and radius, shares of the picture's size (the radius of its lesser side)
DISCS: list[Disc] = [(0.4, 0.5, 0.2), (0.55, 0.5, 0.25)]


def pixels(hw: tuple[int, int], disc: Disc) -> tuple[float, float, float]:
    return disc[0] * hw[1], disc[1] * hw[0], disc[2] * min(hw)


def height_over(hw: tuple[int, int], disc: Disc, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """How far inside a disc points of a picture are, in its pixels; below 0 outside."""
    x, y, radius = pixels(hw, disc)
    return radius - np.hypot(columns[None] - x, rows[:, None] - y)


def prototypes(hw: tuple[int, int], step: int = 4) -> np.ndarray:
    """(1, 32, h, w): two discs in the picture that a letterbox of the model shows, each a prototype."""
    place = Place.of(hw, MODEL_HW, "centre")
    middles = [(np.arange(side // step) + 0.5) * step for side in MODEL_HW]
    rows = (middles[0] - place.top) * hw[0] / place.height
    columns = (middles[1] - place.left) * hw[1] / place.width
    made = np.zeros((1, 32, *(side // step for side in MODEL_HW)), np.float32)
    made[0, 5], made[0, 31] = (height_over(hw, disc, rows, columns) for disc in DISCS)
    return made


def row_of(hw: tuple[int, int], disc: Disc, margin: float = 1.2) -> list[float]:
    """cx cy w h in pixels of the model's picture."""
    place = Place.of(hw, MODEL_HW, "centre")
    (x, y, radius), (sx, sy) = pixels(hw, disc), (place.width / hw[1], place.height / hw[0])
    return [x * sx + place.left, y * sy + place.top, 2 * radius * margin * sx, 2 * radius * margin * sy]


def heads(hw: tuple[int, int], kind: str, margin: float = 1.2) -> np.ndarray:
    """The first output of a model of so many rows as its grid has cells: a cup of 0.9, a book of 0.8, and nothing."""
    cells = sum((MODEL_HW[0] // stride) ** 2 for stride in (8, 16, 32)) * (3 if kind == "yolov5" else 1)
    before = [1.0] if kind == "yolov5" else []
    rows = np.zeros((cells, 4 + len(before) + 3 + 32), np.float32)
    for k, (disc, number, scores) in enumerate(zip(DISCS, (5, 31), ([0.9, 0, 0], [0, 0, 0.8]), strict=True)):
        rows[7 * k + 3] = [*row_of(hw, disc, margin), *before, *scores, *(np.arange(32) == number)]
    return rows.T[None] if kind == "yolov8" else rows[None]


def chosen(hw: tuple[int, int]) -> np.ndarray:
    """The first output where the model has chosen: x_min y_min x_max y_max, score, class, coefficients."""
    rows = np.zeros((1, 300, 38), np.float32)
    for k, (disc, number, score, label) in enumerate(zip(DISCS, (5, 31), (0.9, 0.8), (0, 2), strict=True)):
        cx, cy, w, h = row_of(hw, disc)
        corners = [cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2]
        rows[0, k] = [*corners, score, label, *(np.arange(32) == number)]
    return rows


def seen(
    path: Path, head: np.ndarray, hw: tuple[int, int], proto: np.ndarray | None = None, contract: str = "auto"
) -> Detections:
    """What a model of these outputs sees in a picture."""
    outputs = {"output0": head, "output1": prototypes(hw) if proto is None else proto}
    model = save_constant_model(path / "m.onnx", outputs, (1, 3, *MODEL_HW), "images", 1, NAMES)
    detector = Detector(DetectorParams(contract=contract), model)
    return detector.detect(ColourImage(rgb=np.zeros((*hw, 3), np.uint8), stamp_ns=7))


def require_discs(hw: tuple[int, int], instances: np.ndarray | None, sure: float = 0.35) -> None:
    """Each pixel is of the disc that covers its middle, of the better one where both do; none is asked at an edge."""
    assert instances is not None and instances.shape == hw and instances.dtype == np.uint16
    rows, columns = (np.arange(side) + 0.5 for side in hw)
    first, second = (height_over(hw, disc, rows, columns) for disc in DISCS)
    expected = np.where(first > 0, 1, np.where(second > 0, 2, 0))
    edge = sure * max(1.0, max(hw) / MODEL_HW[0])  # pixels
    known = (np.abs(first) > edge) & (np.abs(second) > edge)
    np.testing.assert_array_equal(instances[known], expected[known])
    assert np.unique(expected[known]).tolist() == [0, 1, 2]


@pytest.mark.parametrize("hw", PICTURES)
@pytest.mark.parametrize("kind", ["yolov8", "yolov8 by row", "yolov5"])
def test_discs_come_back_at_their_pixels_through_the_letterbox(kind: str, hw: tuple[int, int], tmp_path: Path) -> None:
    found = seen(tmp_path, heads(hw, kind), hw)
    assert found.label == ("cup", "book")
    require_discs(hw, found.instances)


def test_a_head_that_has_chosen_already_tells_masks_too(tmp_path: Path) -> None:
    found = seen(tmp_path, chosen((240, 320)), (240, 320), contract="end_to_end")
    assert found.label == ("cup", "book")
    require_discs((240, 320), found.instances)


def test_prototypes_of_any_size_show_the_whole_picture_of_the_model(tmp_path: Path) -> None:
    hw = 240, 320
    require_discs(hw, seen(tmp_path, heads(hw, "yolov8"), hw, prototypes(hw, step=2)).instances)


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


def test_a_model_without_prototypes_tells_no_masks(tmp_path: Path) -> None:
    model = save_constant_model(tmp_path / "m.onnx", {"output0": heads((240, 320), "yolov8")[:, :7]},
                                (1, 3, *MODEL_HW), "images", 1, NAMES | {"task": "detect"})  # fmt: skip
    found = Detector(DetectorParams(), model).detect(ColourImage(rgb=np.zeros((240, 320, 3), np.uint8), stamp_ns=7))
    assert found.label == ("cup", "book") and found.instances is None


def test_candidates_are_boxes_unless_told_otherwise() -> None:
    none = Candidates(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))
    assert none.coefficients is None and none.prototypes is None
