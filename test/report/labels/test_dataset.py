# SPDX-License-Identifier: Apache-2.0
"""A data set as trainers read it."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from objreg_tools.report.labels.dataset import COCO, YOLO, Dataset, Label, polygons

RGB = np.full((100, 200, 3), (200, 40, 20), np.uint8)
MUG = Label("mug", 12, (50, 20, 90, 40), np.ones((20, 40), bool))
CAP = Label("cap", 3, (0, 0, 10, 10), np.eye(10, dtype=bool) | np.tri(10, dtype=bool))


def written(folder: Path, layout: str) -> Dataset:
    made = Dataset(folder, layout, ["cap", "mug"])
    made.add("run_1", "train", RGB, [MUG, CAP])
    made.add("run_2", "val", RGB, [MUG])
    made.finish()
    return made


def test_yolo_has_a_line_of_shares_for_each_object(tmp_path: Path) -> None:
    written(tmp_path, YOLO)
    rows = [line.split() for line in (tmp_path / "labels/train/run_1.txt").read_text().splitlines()]
    assert [(int(row[0]), [float(x) for x in row[1:]]) for row in rows] == [
        (1, [0.35, 0.3, 0.2, 0.2]),
        (0, [0.025, 0.05, 0.05, 0.1]),
    ]
    content = yaml.safe_load((tmp_path / "data.yaml").read_text())
    assert content["names"] == {0: "cap", 1: "mug"} and content["val"] == "images/val"
    picture = cv2.imread(str(Path(content["path"], content["val"], "run_2.jpg")))
    assert picture.shape == (100, 200, 3) and picture[50, 50, ::-1].tolist() == pytest.approx([200, 40, 20], abs=4)


def test_every_picture_of_yolo_has_its_labels_beside_it(tmp_path: Path) -> None:
    written(tmp_path, YOLO)
    pictures, labels = (
        {path.relative_to(tmp_path / top).with_suffix("") for path in (tmp_path / top).rglob("run_*")}
        for top in ("images", "labels")
    )
    assert pictures == labels == {Path("train/run_1"), Path("val/run_2")}


def test_coco_has_boxes_areas_and_classes_from_one(tmp_path: Path) -> None:
    written(tmp_path, COCO)
    content = json.loads((tmp_path / "instances.json").read_text())
    assert content["categories"] == [{"id": 1, "name": "cap"}, {"id": 2, "name": "mug"}]
    assert [one["id"] for one in content["annotations"]] == [1, 2, 3]
    first = content["annotations"][0]
    assert first["bbox"] == [50, 20, 40, 20] and first["area"] == 800 and first["iscrowd"] == 0
    assert first["category_id"] == 2 and first["image_id"] == 1 and first["landmark"] == 12
    names = {one["id"]: one["file_name"] for one in content["images"]}
    assert all((tmp_path / "images" / name).is_file() for name in names.values())


def test_the_parts_of_coco_share_no_picture(tmp_path: Path) -> None:
    written(tmp_path, COCO)
    train, val = (json.loads((tmp_path / f"instances_{part}.json").read_text()) for part in ("train", "val"))
    assert [one["id"] for one in train["images"]] == [1] and [one["id"] for one in val["images"]] == [2]
    assert [one["id"] for one in val["annotations"]] == [3] and val["categories"] == train["categories"]


def test_pycocotools_reads_the_masks(tmp_path: Path) -> None:
    coco = pytest.importorskip("pycocotools.coco")
    written(tmp_path, COCO)
    read = coco.COCO(str(tmp_path / "instances.json"))
    for one in read.loadAnns(read.getAnnIds()):
        assert read.annToMask(one).sum() == pytest.approx(one["area"], rel=0.1)


def test_a_polygon_goes_around_the_pixels_of_a_mask() -> None:
    (polygon,) = polygons(MUG.mask, (50, 20))
    xy = np.array(polygon).reshape(-1, 2)
    assert xy.min(axis=0) == pytest.approx((50, 20), abs=0.2) and xy.max(axis=0) == pytest.approx((90, 40), abs=0.2)
    filled = np.zeros((100, 200), np.uint8)
    for one in polygons(CAP.mask, (5, 5)):
        cv2.fillPoly(filled, [np.floor(np.array(one).reshape(-1, 2)).astype(int)], 1)
    assert filled.sum() == pytest.approx(CAP.mask.sum(), rel=0.15)


def test_two_pieces_have_two_polygons() -> None:
    mask = np.ones((10, 20), bool)
    mask[:, 8:12] = False
    assert len(polygons(mask, (0, 0))) == 2
