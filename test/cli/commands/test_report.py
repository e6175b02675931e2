# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from recording.sample_folders import tum_folder

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
