# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import shlex

from objreg_tools.report.pair.pair_command import pair_command

RUN = "objreg offline 'my rec' --model=coco.onnx --set detector.threshold=0.4 --odometry none --json run.json"


def test_the_options_of_a_run_that_decide_what_is_seen_are_passed_on() -> None:
    words = shlex.split(pair_command({"recording": "/my rec", "about": {"command": RUN}}, 1.0, 62.0004))
    assert words[:5] == ["objreg", "pair", "/my rec", "1.000", "62.000"]
    assert words[6:] == ["--model=coco.onnx", "--set", "detector.threshold=0.4"]


def test_a_run_that_names_no_recording_has_no_command_and_an_old_one_has_no_options() -> None:
    assert pair_command({}, 1.0, 2.0) == ""
    old = [{"recording": "rec"}, {"recording": "rec", "about": {"command": "objreg 'never closed"}}]
    assert {pair_command(summary, 1.0, 2.0) for summary in old} == {"objreg pair rec 1.000 2.000 --keyframes"}
