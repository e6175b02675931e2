# SPDX-License-Identifier: Apache-2.0
"""The files for viewers."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from objreg_tools.report.exports.scene_files import SceneFiles
from report.scenes import walk


def test_only_what_is_asked_for_is_written_and_reported(tmp_path: Path) -> None:
    notices: list[str] = []
    files = SceneFiles(mcap=tmp_path / "run.mcap")
    files.write(walk(), notices.append)
    assert files.wanted == {"--mcap": tmp_path / "run.mcap"} and [f.name for f in tmp_path.iterdir()] == ["run.mcap"]
    (line,) = notices
    assert "the trajectory (odometry, corrected, true), 5 closures, 3 frames with picture and cloud" in line


def test_without_the_sdk_the_error_names_the_extra_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ValueError, match=r"--rerun: expected rerun, got none; pip install 'objreg_ros\[rerun]'"):
        SceneFiles(rerun=Path("run.rrd"))


def test_a_run_without_any_way_is_refused_before_it_begins() -> None:
    SceneFiles().require_trajectory(Path("bag"), is_known=False)
    SceneFiles(mcap=Path("run.mcap")).require_trajectory(Path("bag"), is_known=True)
    with pytest.raises(ValueError, match="bag: --mcap: expected odometry or a ground truth"):
        SceneFiles(mcap=Path("run.mcap")).require_trajectory(Path("bag"), is_known=False)
