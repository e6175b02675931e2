# SPDX-License-Identifier: Apache-2.0
"""A run as a data set: pictures, labels, names and page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from objreg_tools.report.labels.dataset import COCO
from objreg_tools.report.labels.label_export import Exported, LabelOptions, export_labels
from objreg_tools.report.labels.label_names import read_names
from report.labels.scene import BOX, SECOND, FewPictures, seen, square

COUNT = 20
POSES = [(k * SECOND, np.eye(4)) for k in range(COUNT)]


def export(folder: Path, options: LabelOptions | None = None, lost_from: int = COUNT) -> Exported:
    """Of a square that is there until ``lost_from``; another one was seen by one keyframe."""
    album = FewPictures({k * SECOND: seen(k < lost_from, k * SECOND) for k in range(COUNT)})
    things = [square(3, "thing"), square(4, "cup", at=(0.4, 0.0), seconds=(0.0,))]
    return export_labels(folder, "walk", things, POSES, album, options or LabelOptions())  # type: ignore[arg-type]


def boxes(folder: Path) -> list[list[float]]:
    return [
        [float(number) for number in line.split()]
        for file in sorted(folder.glob("labels/*/*.txt"))
        for line in file.read_text().splitlines()
    ]


def test_each_picture_has_the_box_of_the_object_in_it(tmp_path: Path) -> None:
    written = export(tmp_path / "out")
    rows = boxes(tmp_path / "out")
    assert len(rows) == sum(written.pictures.values()) and written.pictures["val"] == 4 and written.labels["thing"] > 10
    x_min, y_min, x_max, y_max = BOX
    true = [0, (x_min + x_max) / 640, (y_min + y_max) / 480, (x_max - x_min) / 320, (y_max - y_min) / 240]
    assert rows[0] == pytest.approx(true, abs=0.01)


def test_pictures_that_show_nothing_are_left_out_and_counted(tmp_path: Path) -> None:
    written = export(tmp_path / "out", lost_from=12)
    assert written.unlabelled == 8 and sum(written.pictures.values()) <= 12


def test_one_picture_of_so_many_is_taken(tmp_path: Path) -> None:
    assert sum(export(tmp_path / "out", LabelOptions(every=5)).pictures.values()) <= 4


def test_a_name_names_an_object_in_all_pictures_and_is_written_to_be_changed(tmp_path: Path) -> None:
    written = export(tmp_path / "out", LabelOptions(layout=COCO, names={3: "mug"}))
    content = json.loads((tmp_path / "out" / "instances.json").read_text())
    assert [one["name"] for one in content["categories"]] == ["mug"] and set(written.labels) == {"mug"}
    assert read_names(tmp_path / "out" / "names.yaml") == {3: "mug"}
    assert "object 3, found as thing" in (tmp_path / "out" / "labels.html").read_text()


def test_without_things_nothing_is_labelled_here(tmp_path: Path) -> None:
    written = export(tmp_path / "out", LabelOptions(named_only=True))
    assert not written.labels and written.unlabelled == COUNT and written.file.is_file()
    assert read_names(tmp_path / "out" / "names.yaml") == {3: "thing"}  # to be named


def test_a_folder_that_holds_something_is_refused_and_left(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(FileExistsError, match="expected a new or empty folder"):
        export(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_of_an_export_that_fails_nothing_remains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> str:
        raise OSError("the disk is full")

    monkeypatch.setattr("objreg_tools.report.labels.label_export.labels_page", full)
    with pytest.raises(OSError, match="full"):
        export(tmp_path / "out")
    assert not (tmp_path / "out").exists()
