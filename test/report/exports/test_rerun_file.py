# SPDX-License-Identifier: Apache-2.0
"""A run as a recording for Rerun, read back."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from objreg_tools.report.exports.rerun_file import write_rerun
from report.runs import STEP_NS
from report.scenes import SEEN, walk


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict]]:
    """The rows of each entity of a run, by the names of their columns."""
    folder = tmp_path_factory.mktemp("rerun")
    assert write_rerun(folder / "run.rrd", walk()) == len(SEEN)
    assert [file.name for file in folder.iterdir()] == ["run.rrd"]
    found: dict[str, list[dict]] = {}
    for chunk in RrdReader(folder / "run.rrd").stream().to_chunks():
        found.setdefault(chunk.entity_path, []).extend(rows(chunk.to_record_batch()))
    return found


def rows(batch: Any) -> list[dict]:
    """The rows of a batch; its ``time`` in ns."""
    batch = batch.drop_columns([name for name in ("log_time",) if name in batch.schema.names])
    if "time" in batch.schema.names:
        place = batch.schema.get_field_index("time")
        batch = batch.set_column(place, "time", batch.column(place).cast("int64"))
    return batch.to_pylist()


def test_the_three_ways_are_lines(read: dict[str, list[dict]]) -> None:
    for name, way in walk().trajectories.items():
        (row,) = read[f"/map/trajectories/{name}"]
        assert np.allclose(row["LineStrips3D:strips"][0], way.positions, atol=1e-5)
        assert row["LineStrips3D:labels"] == [name]


def test_closures_are_lines_by_verdict_with_their_labels_and_errors(read: dict[str, list[dict]]) -> None:
    edges = walk().edges
    for verdict in {edge.verdict for edge in edges}:
        (row,) = read[f"/map/closures/{verdict}"]
        of = [edge for edge in edges if edge.verdict == verdict]
        assert np.allclose(row["LineStrips3D:strips"], [edge.ends for edge in of], atol=1e-5)
        assert row["LineStrips3D:labels"] == [edge.text for edge in of]


def test_objects_are_points_by_label(read: dict[str, list[dict]]) -> None:
    for label, count in Counter(label for label, _ in walk().objects).items():
        (row,) = read[f"/map/objects/{label}"]
        assert len(row["Points3D:positions"]) == count


def test_the_camera_has_its_picture_and_its_cloud_at_each_moment(read: dict[str, list[dict]]) -> None:
    moments = list(walk().moments())
    for path, column in {
        "/map/camera/image": "EncodedImage:blob",
        "/map/camera/cloud": "Points3D:positions",
        "/map/camera": "Transform3D:translation",
    }.items():
        stamps = [row["time"] for row in read[path] if row.get(column)]
        assert sorted(stamps) == [k * STEP_NS for k in SEEN]
    clouds = sorted(read["/map/camera/cloud"], key=lambda row: row["time"])
    assert [len(row["Points3D:positions"]) for row in clouds] == [len(moment.xyz) for moment in moments]


def test_what_cannot_be_finished_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("objreg_ros.whole_file.os.replace", full)
    with pytest.raises(OSError, match="no space"):
        write_rerun(tmp_path / "run.rrd", walk())
    assert not list(tmp_path.iterdir())
