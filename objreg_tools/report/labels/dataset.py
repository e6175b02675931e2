# SPDX-License-Identifier: Apache-2.0
"""A data set of labelled pictures as files, in the layouts that trainers read.

YOLO: ``images/<part>/NAME.jpg``, ``labels/<part>/NAME.txt`` with ``class x_centre y_centre width height`` a line, in
shares of the picture, classes from 0, and ``data.yaml``. COCO: ``images/NAME.jpg``, and ``instances.json`` of all,
``instances_train.json``, ``instances_val.json``, ids from 1, boxes ``x y width height`` px, masks as polygons.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import yaml

from objreg_ros.data.checked import Array
from objreg_ros.whole_file import write_whole
from objreg_tools.report.labels.split import TRAIN, VAL

YOLO, COCO = "yolo", "coco"
FORMATS = (YOLO, COCO)
QUALITY = 95  # of a JPEG
FINE = 4  # a mask is enlarged so often before its border is traced: a polygon goes through the middles of pixels
SLACK = 2.0  # px of the enlarged mask that a corner may be off


class Label(NamedTuple):
    """An object in a picture: its class, its landmark, ``xyxy`` px half open, and ``mask (h, w) bool`` from there."""

    name: str
    landmark: int
    xyxy: tuple[int, int, int, int]
    mask: Array


@dataclass
class Dataset:
    """Writes pictures with their labels into ``folder``; ``classes`` in the order of their numbers."""

    folder: Path
    layout: str
    classes: Sequence[str]
    images: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)

    def add(self, name: str, part: str, rgb: Array, labels: Sequence[Label]) -> Path:
        """Write one picture (H, W, 3) of the part ``train`` or ``val``; where it lies."""
        height, width = rgb.shape[:2]
        below = f"images/{part}" if self.layout == YOLO else "images"
        path = self.folder / below / f"{name}.jpg"
        path.parent.mkdir(parents=True, exist_ok=True)
        _, jpeg = cv2.imencode(".jpg", np.ascontiguousarray(rgb[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        write_whole(path, jpeg.tobytes())
        number = len(self.images) + 1
        self.images.append({"id": number, "file_name": path.name, "width": width, "height": height, "part": part})
        self.annotations += [self._annotation(label, number, k) for k, label in enumerate(labels, 1)]
        if self.layout == YOLO:
            text = "".join(self._line(label, width, height) for label in labels)
            file = self.folder / "labels" / part / f"{name}.txt"
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, text)
        return path

    def finish(self) -> Path:
        """Write what says what is in the folder; that file."""
        if self.layout == YOLO:
            content = {"path": str(self.folder.resolve()), TRAIN: f"images/{TRAIN}", VAL: f"images/{VAL}"}
            names = dict(enumerate(self.classes))
            for part in (TRAIN, VAL):
                (self.folder / "images" / part).mkdir(parents=True, exist_ok=True)
            write_whole(
                self.folder / "data.yaml",
                yaml.safe_dump({**content, "names": names}, allow_unicode=True, sort_keys=False),
            )
            return self.folder / "data.yaml"
        for part in (TRAIN, VAL):
            write_whole(self.folder / f"instances_{part}.json", json.dumps(self._instances(part)))
        write_whole(self.folder / "instances.json", json.dumps(self._instances()))
        return self.folder / "instances.json"

    def _line(self, label: Label, width: int, height: int) -> str:
        x_min, y_min, x_max, y_max = label.xyxy
        numbers = (
            (x_min + x_max) / 2 / width,
            (y_min + y_max) / 2 / height,
            (x_max - x_min) / width,
            (y_max - y_min) / height,
        )
        return f"{self.classes.index(label.name)} {' '.join(f'{number:.6f}' for number in numbers)}\n"

    def _annotation(self, label: Label, image: int, _: int) -> dict[str, Any]:
        x_min, y_min, x_max, y_max = label.xyxy
        return {
            "id": len(self.annotations) + _,
            "image_id": image,
            "category_id": self.classes.index(label.name) + 1,
            "bbox": [x_min, y_min, x_max - x_min, y_max - y_min],
            "area": int(label.mask.sum()),
            "segmentation": polygons(label.mask, (x_min, y_min)),
            "iscrowd": 0,
            "landmark": label.landmark,
        }

    def _instances(self, part: str | None = None) -> dict[str, Any]:
        images = [one for one in self.images if part in (None, one["part"])]
        ids = {one["id"] for one in images}
        return {
            "images": images,
            "annotations": [one for one in self.annotations if one["image_id"] in ids],
            "categories": [{"id": k, "name": name} for k, name in enumerate(self.classes, 1)],
        }


def polygons(mask: Array, corner: tuple[int, int]) -> list[list[float]]:
    """The outer borders of a mask (h, w) whose upper left pixel is at ``corner``, as ``x y x y …`` px of the picture.

    Along the borders of pixels, not through their middles: a pixel at 3 goes from 3 to 4. Holes are not left open.
    """
    fine = np.kron(mask.astype(np.uint8), np.ones((FINE, FINE), np.uint8))
    contours, _ = cv2.findContours(fine, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    found = []
    for contour in contours:
        traced = cv2.approxPolyDP(contour, SLACK, closed=True)[:, 0].astype(float)
        if len(traced) >= 3:
            xy = (traced + 0.5) / FINE + corner
            found.append([round(value, 2) for value in xy.ravel().tolist()])
    return found
