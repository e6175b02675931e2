# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from recording.sample_folders import tum_folder
from recording.vision import detected_bag

from objreg_tools.cli import group
from objreg_tools.cli.commands.report import command


@pytest.mark.parametrize("name", ["nothere.json", "nothere"])
def test_what_is_not_there_is_refused_before_anything_runs(tmp_path: Path, name: str) -> None:
    recording = tum_folder(tmp_path / "tum")
    runs = [str(recording), str(tmp_path / name)]
    with pytest.raises(FileNotFoundError, match=r"expected the JSON of .* or a recording, got nothing at .*nothere"):
        CliRunner().invoke(command, [*runs, "--out", str(tmp_path / "out.html")], catch_exceptions=False)
    assert list(tmp_path.iterdir()) == [recording]


def test_a_page_that_cannot_be_written_is_refused_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = tum_folder(tmp_path / "tum")
    monkeypatch.setattr("objreg_tools.cli.recorded.run_offline", lambda *_: pytest.fail("a recording was run"))
    with pytest.raises(OSError, match=r"--out: expected an existing folder .*nowhere, got none; create it"):
        words = ["report", str(recording), "--out", str(tmp_path / "nowhere/x.html")]
        CliRunner().invoke(group, words, catch_exceptions=False, standalone_mode=False)
    assert not (tmp_path / "nowhere").exists()


def test_a_recording_is_run_with_the_detections_that_it_holds(tmp_path: Path) -> None:
    bag, page = detected_bag(tmp_path / "bag"), tmp_path / "out.html"
    words = [str(bag), "--detections", "/yolo/detections", "--max-frames", "3", "--out", str(page)]
    done = CliRunner().invoke(command, words, catch_exceptions=False)
    assert done.exit_code == 0 and "3 frames, 3 detections" in done.output
    assert "mug" in page.read_text(encoding="utf-8")


def test_options_of_a_run_are_refused_where_all_runs_are_done(tmp_path: Path) -> None:
    run = tmp_path / "run.json"
    run.touch()
    with pytest.raises(ValueError, match="expected a recording that is run with these options, got runs that are done"):
        CliRunner().invoke(command, [str(run), "--detections", "/yolo/detections"], catch_exceptions=False)
