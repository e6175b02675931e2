# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.cli import NOTHING
from objreg_ros.cli.told import closing_lines, exit_code, tell
from objreg_ros.recording.finding import Finding

FINDING = Finding("nothing is seen", "it is dark", "put on the light", "no-detections")


def test_a_finding_is_a_block_and_a_remark_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    tell([FINDING, Finding("no odometry")])
    assert capsys.readouterr().out.splitlines() == [
        "! nothing is seen", "    likely: it is dark", "    next: put on the light",
        "    more: docs/troubleshooting.md#no-detections", "! no odometry",
    ]  # fmt: skip


def test_a_run_without_frames_has_an_exit_code_of_its_own() -> None:
    assert exit_code({"frames": 0}) == NOTHING == 3 and exit_code({"frames": 1}) == 0


def test_the_last_lines_say_whether_it_worked_where_to_look_and_what_to_do() -> None:
    run = {"frames": 9, "constraints": [], "detections": 0}
    failed = list(closing_lines(run, [FINDING], Path("out"), own=True))
    assert failed[0] == "No loop was closed: nothing is seen." and failed[-1] == "Next: put on the light."
    assert "out/report.html" in failed[1] and "out/logs" in failed[1]
    assert "YOUR_RECORDING" in list(closing_lines({**run, "constraints": [{}]}, [], Path("out"), own=False))[-1]
