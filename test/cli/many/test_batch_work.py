# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from recording.sample_folders import tum_folder

from objreg_tools.cli.many import batch_work
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings

RESULT = {
    "recording": "/tum",
    "findings": [],
    **dict.fromkeys(("frames", "detections", "objects"), 0),
    "constraints": [],
    "refusals": [],
    "rejected": {},
    "stage_ms": {},
    "truth": dict.fromkeys(("count", "strict", "loose", "false"), 0),
}


def work(folder: Path, *changes: str) -> BatchWork:
    return BatchWork.of(RecordedOptions(read_settings(None, changes)), folder, ("batch",))


def test_a_result_holds_until_a_setting_or_the_recording_changes(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "tum", frames=2)
    one = work(tmp_path)
    assert one.differing(recording) is None
    made = {**RESULT, "batch": {"made": one.made_of(recording), "seconds": 1.0, "notes": []}}
    one.file(recording).write_text(json.dumps(made))
    assert one.differing(recording) == []
    assert work(tmp_path, "registrar.seed=7").differing(recording) == ["registrar.seed"]
    (recording / "rgb.txt").write_text("")
    assert one.differing(recording) == ["recording"]


def test_what_is_not_json_of_a_batch_is_no_result(tmp_path: Path) -> None:
    one = work(tmp_path)
    for text in ("{", "[]", "{}", "[" * 100_000, '{"batch": null}', "\x00", ""):
        one.file(tmp_path / "tum").write_text(text)
        with pytest.raises(
            ValueError, match=r"tum-.*\.json: expected a result of a batch, got one that cannot be used"
        ):
            one.read(tmp_path / "tum")


def test_a_result_that_is_too_large_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = work(tmp_path)
    one.file(tmp_path / "tum").write_text(" " * 101)
    monkeypatch.setattr(batch_work, "MOST_BYTES", 100)
    with pytest.raises(ValueError, match="expected at most 100 bytes, got 101"):
        one.read(tmp_path / "tum")


def test_a_pipe_in_the_place_of_a_result_is_neither_read_nor_written(tmp_path: Path) -> None:
    recording, one = tum_folder(tmp_path / "tum", frames=2), work(tmp_path)
    os.mkfifo(one.file(recording))
    with pytest.raises(ValueError, match="expected a plain file or none"):
        one.read(recording)
    with pytest.raises(OSError, match="expected a plain file or none"):
        one(recording)
