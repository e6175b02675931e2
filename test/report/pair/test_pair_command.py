# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import shlex

import numpy as np

from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Reason, refused
from objreg_tools.report.pair.pair_command import OF_RUN, pair_command, passed_on, veto_command

RUN = "objreg offline 'my rec' --model=coco.onnx --set detector.threshold=0.4 --odometry none --json run.json"


def test_the_options_of_a_run_that_decide_what_is_seen_are_passed_on() -> None:
    arguments = shlex.split(pair_command({"recording": "/my rec", "about": {"command": RUN}}, 1.0, 62.0004))
    assert arguments[:5] == ["objreg", "pair", "/my rec", "1.000", "62.000"]
    assert arguments[6:] == ["--model=coco.onnx", "--set", "detector.threshold=0.4"]


def test_a_run_that_names_no_recording_has_no_command_and_an_old_one_has_no_options() -> None:
    assert pair_command({}, 1.0, 2.0) == ""
    old = [{"recording": "rec"}, {"recording": "rec", "about": {"command": "objreg 'never closed"}}]
    assert {pair_command(summary, 1.0, 2.0) for summary in old} == {"objreg pair rec 1.000 2.000 --keyframes"}


def test_a_closure_may_be_withdrawn_in_the_store_of_the_run_and_a_refusal_may_not() -> None:
    closure = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",))
    name = closure_id(closure)
    assert veto_command({"store": "/my place.db"}, closure) == f"objreg veto '/my place.db' {name}"
    assert veto_command({"store": ""}, closure) == veto_command({}, closure) == f"objreg veto STORE {name}"
    assert veto_command({}, refused(closure, Reason.TEXTURE, "")) == ""


def test_what_runs_a_whole_recording_again_has_its_odometry_too() -> None:
    options = ["--model=coco.onnx", "--set", "detector.threshold=0.4", "--odometry", "none"]
    assert [*passed_on(shlex.split(RUN), OF_RUN)] == options
