# SPDX-License-Identifier: Apache-2.0
"""A tiny segmentation model of known answers: it sees two discs in every picture of one size, a cup before a book."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import Intrinsics
from objreg_ros.detector.picture import Placement

from .tiny_model import save_constant_model

MODEL_HW = 320, 320
NAMES = {"names": "{0: 'cup', 1: 'pot', 2: 'book'}", "stride": "32", "task": "segment"}
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
    place = Placement.of(hw, MODEL_HW, "centre")
    middles = [(np.arange(side // step) + 0.5) * step for side in MODEL_HW]
    rows = (middles[0] - place.top) * hw[0] / place.height
    columns = (middles[1] - place.left) * hw[1] / place.width
    made = np.zeros((1, 32, *(side // step for side in MODEL_HW)), np.float32)
    made[0, 5], made[0, 31] = (height_over(hw, disc, rows, columns) for disc in DISCS)
    return made


def row_of(hw: tuple[int, int], disc: Disc, margin: float = 1.2) -> list[float]:
    """cx cy w h in pixels of the model's picture."""
    place = Placement.of(hw, MODEL_HW, "centre")
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


def save_disc_model(path: Path, hw: tuple[int, int], head: np.ndarray | None = None, step: int = 4) -> Path:
    """The model, with prototypes of one value to so many pixels."""
    outputs = {"output0": heads(hw, "yolov8") if head is None else head, "output1": prototypes(hw, step)}
    return save_constant_model(path, outputs, (1, 3, *MODEL_HW), "images", 1, NAMES)


def instances(hw: tuple[int, int], sure: float = 0.35) -> tuple[np.ndarray, np.ndarray]:
    """Of each pixel the disc that covers its middle, 1, 2 or 0 for none, and whether no edge is near it.

    The better one has what both cover. ``sure`` is how far edges are, in pixels of picture or model, the larger ones.
    """
    rows, columns = (np.arange(side) + 0.5 for side in hw)
    first, second = (height_over(hw, disc, rows, columns) for disc in DISCS)
    edge = sure * max(1.0, max(hw) / MODEL_HW[0])
    known = (np.abs(first) > edge) & (np.abs(second) > edge)
    return np.where(first > 0, 1, np.where(second > 0, 2, 0)), known


def require_objects(camera: Intrinsics, objects: Sequence[ObjectCloud]) -> None:
    """A cup and a book whose points are those of their discs in the picture, and nothing beside."""
    expected, known = instances((camera.height, camera.width))
    assert [one.label for one in objects] == ["cup", "book"]
    for k, one in enumerate(objects, start=1):
        x, y, z = one.xyz.astype(np.float64).T
        columns, rows = np.rint([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy]).astype(int)
        shown = np.zeros(expected.shape, bool)
        shown[rows, columns] = True
        assert (expected == k)[shown & known].all()
        assert shown.sum() > 0.8 * (expected == k).sum()
