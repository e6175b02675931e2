# SPDX-License-Identifier: Apache-2.0
"""`objreg export-labels` on a wall that goes away."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from detector.tiny_model import save_constant_model, tf_outputs
from recording.sample_folders import STEP_NS, tum_folder

from objreg_tools.cli import NOTHING, group
from objreg_tools.report.labels.mapped_objects import MappedObject, ObjectView


def patch_of_wall() -> MappedObject:
    """Of the wall as it is in the first frame, 1 m away: 20 px wide and high in the middle of the picture."""
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.arange(-0.195, 0.2, 0.01),) * 2))
    xyz = np.column_stack([x, y, np.ones(x.size)])
    views = tuple(
        ObjectView(stamp_ns=k, xyz=xyz, normals=np.tile([0.0, 0.0, -1.0], (len(xyz), 1)), spacing=0.01) for k in (0, 1)
    )
    return MappedObject(landmark=7, label="thing", views=views)


@pytest.fixture
def on_a_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run is known: its camera stays where it is, and the one object is a part of the wall."""

    def known(*_: Any) -> tuple[Any, tuple[MappedObject, ...], dict[str, Any]]:
        frames = [SimpleNamespace(stamp_ns=k * STEP_NS, T_map_camera=np.eye(4)) for k in range(3)]
        return SimpleNamespace(map=SimpleNamespace(frames=frames)), (patch_of_wall(),), {"rectified": "auto"}

    monkeypatch.setattr("objreg_tools.cli.commands.export_labels.run_on_map", known)


def export(*arguments: object) -> Result:
    return CliRunner().invoke(
        group, ["export-labels", *map(str, arguments)], catch_exceptions=False, standalone_mode=False
    )


def test_an_object_is_labelled_where_depth_shows_it(on_a_map: None, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = export(tum_folder(tmp_path / "tum"), "--out", out, "--name", "7=wall", "--name", "9=cup")
    assert result.return_value == 0 and "wall: 1 labels" in result.output and "2 show none" in result.output
    assert "this run has no object 9" in result.output
    (file,) = out.glob("labels/*/tum_*.txt")
    number, *box = (float(number) for number in file.read_text().split())
    assert number == 0 and box == pytest.approx([0.5, 0.5, 20 / 64, 20 / 48], abs=0.03)
    assert (out / "labels.html").is_file() and (out / "names.yaml").is_file()


def test_a_run_that_shows_no_object_ends_with_its_own_status(tmp_path: Path) -> None:
    (tmp_path / "labelmap.txt").write_text("cup\ntv\n")
    model = save_constant_model(tmp_path / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))
    result = export(tum_folder(tmp_path / "tum"), "--model", model, "--out", tmp_path / "out")
    assert result.return_value == NOTHING and "0 train, 0 val" in result.output


def test_what_cannot_be_is_refused_before_the_run(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "kept.txt").write_text("mine")
    with pytest.raises(ValueError, match="--out: expected a new or empty folder"):
        export(folder, "--out", tmp_path / "mine")
    with pytest.raises(ValueError, match="--name: expected a landmark"):
        export(folder, "--out", tmp_path / "out", "--name", "mug")
    with pytest.raises(ValueError, match="--odometry none: expected a trajectory"):
        export(folder, "--out", tmp_path / "out", "--odometry", "none")
