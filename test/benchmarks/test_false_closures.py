# SPDX-License-Identifier: Apache-2.0
"""What the hunt for false closures counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.geometry import pose
from objreg_tools.truth import Truth

WRONG = (
    *("loop", "loop:x", "foo:1", "loop:1:eye", "loop:1:qvga:much", "loop:1:qvga:stress:"),
    *("loop:1:sensor=eye", "loop:1:lag=1", "loop:1:lag_ms=x", "loop:1:lens=round", "loop:1:lag_ms=1:qvga"),
)
STILL = Truth([(0, np.eye(4)), (10**8, np.eye(4))])


def beside(metres: float) -> np.ndarray:
    return pose(np.eye(3), np.array([metres, 0.0, 0.0]))


def closure(metres: float, objects: int) -> LoopClosure:
    evidence = {"matched": float(objects)}
    T = beside(metres)
    return LoopClosure(from_ns=0, to_ns=10**8, T_from_to=T, covariance=np.eye(6), labels=(), evidence=evidence)


def refused(metres: float | None, reason: Reason) -> Rejected:
    T = None if metres is None else beside(metres)
    return Rejected(reason=reason, from_ns=0, to_ns=10**8, detail="", T_from_to=T)


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("loop:7", ("loop", 7, "kinect", False)),
        ("loop:7:stress", ("loop", 7, "kinect", True)),
        ("look-alikes:82:qvga", ("look-alikes", 82, "qvga", False)),
        ("moved:103:azure_kinect:stress", ("moved", 103, "azure_kinect", True)),
    ],
)
def test_a_recording_is_named_by_scenario_seed_camera_and_stress(text: str, plan: tuple) -> None:
    from false_closures import plan_of

    assert plan_of(text) == (*plan, "kinect_v1", ())


def test_a_recording_may_name_its_sensor_and_what_is_wrong_with_it() -> None:
    from false_closures import plan_of

    plan = plan_of("loop:7:sensor=realsense_d435:lens=0.1,0,0,0:lag_ms=25:stress")
    assert plan == ("loop", 7, "realsense_d435", True, "realsense_d435", ("rig.lag_ms=25", "rig.distortion=0.1,0,0,0"))
    assert plan.name == "loop 7, realsense_d435, realsense_d435 depth, lag_ms=25, distortion=0.1,0,0,0, stress"
    assert plan_of("loop:7:qvga:sensor=azure_kinect")[2:5] == ("qvga", False, "azure_kinect")


@pytest.mark.parametrize("text", WRONG)
def test_what_names_no_recording_is_refused(text: str) -> None:
    from false_closures import plan_of

    with pytest.raises(click.BadParameter, match="expected SCENARIO:SEED"):
        plan_of(text)


def test_closures_are_counted_by_truth_and_by_what_speaks_for_them_and_right_refusals_by_reason() -> None:
    from false_closures import added, figures

    closures = [closure(0.01, 3), closure(0.07, 2), closure(0.12, 1), closure(0.3, 1)]
    refusals = [
        refused(0.02, Reason.SLACK),
        refused(0.5, Reason.SLACK),
        refused(None, Reason.NO_HYPOTHESIS),
        refused(None, Reason.NO_CANDIDATE),
    ]
    row = figures(closures, refusals, STILL)
    assert row["tried"] == 7
    assert row["all"] == {"count": 4, "strict": 1, "loose": 2, "false": 1}
    assert row["one object"] == {"count": 2, "strict": 0, "loose": 0, "false": 1}
    assert row["refused_though_right"] == {Reason.SLACK.value: 1}
    assert added([row, row])["several objects"] == {"count": 4, "strict": 2, "loose": 4, "false": 0}


def test_fresh_recordings_are_of_every_scenario_and_camera_in_rooms_of_their_own() -> None:
    from false_closures import fresh_plans

    plans = fresh_plans(2100, 25)
    assert [plan.seed for plan in plans] == list(range(2100, 2125))
    assert len({(plan.scenario, plan.camera, plan.sensor) for plan in plans}) == 16
    assert {plan.sensor for plan in plans} == {"kinect_v1", "realsense_d435", "azure_kinect"}
    assert 10 <= sum(plan.stress for plan in plans) <= 15


def test_what_is_kept_of_a_recording_is_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import false_closures

    asked: list[int] = []

    def measure(plan: Any, frames: int, model: str) -> dict[str, Any]:
        asked.append(frames)
        return {"tried": frames}

    monkeypatch.setattr(false_closures, "measure", measure)
    (plan,) = false_closures.fresh_plans(7, 1)
    rows = [false_closures.measured(plan, frames, "a/b.onnx", tmp_path) for frames in (60, 60, 90)]
    assert [row["tried"] for row in rows] == [60, 60, 90] and asked == [60, 90]
    assert false_closures.measured(plan, 60, "", None) == {"tried": 60}
