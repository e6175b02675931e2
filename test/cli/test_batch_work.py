# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

from recording.folders import tum_folder

from objreg_ros.cli.batch_work import BatchWork
from objreg_ros.cli.recorded import Asked
from objreg_ros.cli.settings import read_settings


def work(folder: Path, *changes: str) -> BatchWork:
    return BatchWork.of(Asked(read_settings(None, changes)), folder, ("batch",))


def test_a_result_holds_until_a_setting_or_the_recording_changes(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "tum", frames=2)
    one = work(tmp_path)
    assert one.differing(recording) is None
    made = json.dumps({"batch": {"made": one._made_of(recording)}})
    one.file(recording).write_text(made)
    assert one.differing(recording) == []
    assert work(tmp_path, "registrar.seed=7").differing(recording) == ["registrar.seed"]
    (recording / "rgb.txt").write_text("")
    assert one.differing(recording) == ["recording"]


def test_what_is_not_json_of_a_batch_is_no_result(tmp_path: Path) -> None:
    one = work(tmp_path)
    for text in ("{", "[]", "{}"):
        one.file(tmp_path / "tum").write_text(text)
        assert one.read(tmp_path / "tum") is None
