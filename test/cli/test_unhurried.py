# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pytest
from recording.sample_folders import tum_folder

from objreg_ros import share
from objreg_tools.cli.unhurried import run_unhurried
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs

GIVEN = share.EMBEDDED, None, "", None, ("detector.max_rate=0",)


@pytest.mark.parametrize("seconds", [None, 0.05])
def test_every_frame_of_the_stretch_is_in_the_run(tmp_path: Path, seconds: float | None) -> None:
    folder = tum_folder(tmp_path / "desk", frames=4)
    with open_recording(folder) as source:
        inputs = choose_inputs(source.topics, {})
        depth = [record.stamp_ns for record in source.records({inputs.depth or ""})]
        end_ns = None if seconds is None else source.start_ns + round(seconds * 1e9)
    wanted = [stamp_ns for stamp_ns in depth if end_ns is None or stamp_ns <= end_ns]
    run = run_unhurried(folder, "desk", *GIVEN, inputs.outright, seconds)
    assert run.summary["name"] == "desk, every frame" and run.summary["frames"] == len(wanted) <= 4
    assert json.loads(json.dumps(run.json))["findings"] and run.summary["dropped"] == {}
