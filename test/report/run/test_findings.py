# SPDX-License-Identifier: Apache-2.0
"""A run that found nothing says where it stopped."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from recording.sample_folders import records, tum_folder

from objreg_ros.plausibility.finding import Finding
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.report.closures.closed_revisits import ClosedRevisits
from objreg_tools.report.run.findings import as_json, find, setting, verdict

EMPTY: dict[str, Any] = {"frames": 40, "detections": 30, "objects": 20, "constraints": [], "rejected": {}}
ONE = ClosedRevisits(revisits=((0,),))
CLOSED = {**EMPTY, "constraints": [{}], "truth": {"count": 0}}


def anchors(**changed: Any) -> list[str]:
    return [finding.anchor for finding in find({**EMPTY, **changed})]


def test_the_first_step_that_gave_nothing_is_named() -> None:
    assert anchors(frames=0) == ["no-frame-got-through"] and anchors(detections=0) == ["no-detections"]
    assert anchors(objects=0) == ["no-objects"] and anchors(rejected={"no_candidate": 4}) == ["no-revisit"]
    assert anchors(rejected={"low_overlap": 2, "no_candidate": 1}) == ["all-refused"]
    assert find(CLOSED) == ()


def test_what_is_wrong_with_the_recording_explains_refusals_first() -> None:
    rejected = {**EMPTY, "rejected": {"low_overlap": 2}}
    (refused,) = find(rejected)
    (after, units) = find(rejected, [Finding("depth begins at 3.6 m", "other steps", "", "units")])
    assert after.cause == f"what is wrong with the recording, below; else {refused.cause}" and units.anchor == "units"


@pytest.mark.parametrize(
    ("reason", "anchor"),
    [("over_budget", "over-budget"), ("clock_began_anew", "clock_began_anew"), ("unreadable", "unreadable")],
)
def test_candidates_that_were_passed_over_are_no_sign_of_a_camera_that_did_not_come_back(
    reason: str, anchor: str, repository: Path
) -> None:
    (finding,) = find({**EMPTY, "rejected": {"no_candidate": 9, reason: 4}})
    assert finding.anchor == anchor and finding.what.startswith("4 candidates were not tried: ") and finding.todo
    assert anchors(rejected={"low_overlap": 1, reason: 4})[0] == "all-refused"
    headings = (repository / "docs/troubleshooting.md").read_text(encoding="utf-8").lower().replace("-", " ")
    assert re.search(rf"^#+ `?{anchor.replace('-', ' ')}`?$", headings, re.MULTILINE)


def test_what_was_dropped_is_stated_with_the_first_complaint() -> None:
    run = {**EMPTY, "frames": 0, "dropped": {"malformed_depth": 9}, "complaints": {"malformed_depth": "odd bytes"}}
    (finding,) = find(run)
    assert "9 malformed_depth" in finding.what and "odd bytes" in finding.cause and "objreg inspect" in finding.todo


def test_refusals_are_counted_without_what_was_never_tried() -> None:
    (finding,) = find({**EMPTY, "rejected": {"low_overlap": 2, "gravity_not_kept": 5, "redundant": 9}})
    assert finding.what == "all 7 candidates were refused: 5 gravity_not_kept, 2 low_overlap"


def test_the_live_graph_is_judged_by_its_counters_and_its_frames() -> None:
    counters = {"published": 0, "received": 100, "dropped": {"overtaken": 50}}
    row = {"stamp_ns": 1, "labels": ["cup"], "objects": []}
    run = {"nodes": {"segmenter": {**counters, "published": 3}}, "glimpses": [row], "constraints": []}
    assert [finding.anchor for finding in find(run)] == ["no-objects", "overtaken"]


def test_few_overtaken_frames_are_usual_and_a_search_that_ended_early_is_not() -> None:
    counters = {"received": 100, "dropped": {"overtaken": 4}}
    assert not find({**CLOSED, "nodes": {"detector": counters}, "frames": 9})
    assert [f.anchor for f in find({**CLOSED, "rejected": {"over_budget": 2}})] == ["over-budget"]


@pytest.mark.parametrize(
    ("simulated", "run", "said"),
    [(True, EMPTY, False), (False, EMPTY, True), (False, CLOSED, False),
     (False, {**EMPTY, "frames": 0}, False), (None, EMPTY, False),
     (None, {**CLOSED, "detections": 2}, True)],
)  # fmt: skip
def test_the_model_of_simulated_rooms_is_named_on_real_ones(simulated: bool | None, run: dict, said: bool) -> None:
    findings = find({**run, "model": "objreg_ssd.onnx", "simulated": simulated})
    assert ("model-of-simulated-rooms" in [finding.anchor for finding in findings]) is said


def test_a_recording_is_known_as_simulated_by_the_truth_beside_it(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    for path, simulated in ((tum_folder(tmp_path / "tum"), False), (tmp_path / "bag", None)):
        with open_recording(path) as source:
            found = setting(source, choose_inputs(source.topics), "objreg_ssd.onnx")
        of_pictures = {"pictures": True} if simulated is False else {}
        assert found == {"model": "objreg_ssd.onnx", "simulated": simulated, **of_pictures}


def test_of_a_folder_of_pictures_no_other_topic_is_to_be_taken() -> None:
    run = {**EMPTY, "frames": 0, "dropped": {"malformed_depth": 3}}
    assert "--remap" in find(run)[0].todo
    (finding,) = find({**run, "pictures": True})
    assert "--remap" not in finding.todo and "replace these files" in finding.todo


def test_a_recording_with_its_truth_beside_it_is_simulated(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    (tmp_path / "bag/truth").mkdir()
    (tmp_path / "bag/truth/frames.jsonl").touch()
    with open_recording(tmp_path / "bag") as source:
        assert setting(source, choose_inputs(source.topics), "objreg_ssd.onnx")["simulated"] is True


def test_what_the_recording_has_comes_after_where_the_run_stopped() -> None:
    of_recording = Finding("a", "b", "c", "depth-scale")
    found = find({**EMPTY, "objects": 0}, [of_recording])
    assert found[1] is of_recording
    assert as_json(found)[1] == {"what": "a", "cause": "b", "todo": "c", "anchor": "depth-scale"}


def test_one_line_says_whether_it_worked() -> None:
    assert verdict({**EMPTY, "frames": 0}) == "It did not work: no frame got through."
    assert verdict(EMPTY, find(EMPTY)).startswith("No loop was closed: 20 objects in 40 frames")
    assert verdict(CLOSED, (), ONE) == (
        "It worked: 1 revisit, closed by 1 constraint, in 40 frames; there is no truth to judge it by."
    )
    off = {"count": 2, "rotation_deg": {"median": 9.0}, "translation_cm": {"median": 4.0}}
    three = {**CLOSED, "constraints": [{}, {}, {}]}
    assert "none of the 2 that truth can judge is false; 1 could not be judged, 9.00° and 4.0 cm off" in verdict(
        {**three, "truth": {**off, "false": 0}}, (), ONE
    )
    assert verdict({**three, "truth": {**off, "false": 1}}, (), ONE).startswith("Not quite")


def test_a_camera_that_stayed_closed_no_loop_however_many_constraints_there_are() -> None:
    stayed = ClosedRevisits(stayed=tuple(range(8)))
    assert verdict({**CLOSED, "constraints": [{}] * 8}, (), stayed) == (
        "No loop was closed: the camera never left: 8 constraints between keyframes of one place, 0 revisits, in 40 "
        "frames; there is no truth to judge them by."
    )
    assert verdict(CLOSED, (), ClosedRevisits(unknown=(0,))).startswith("It is not known whether a loop was closed: ")


def test_a_corrected_trajectory_that_is_worse_is_called_worse() -> None:
    worse = {"of": "odometry", "error_cm": {"before": 1.0, "after": 1.11}}
    said = verdict(CLOSED, (), ONE, worse)
    assert said.startswith("Not quite: ") and said.endswith("the corrected trajectory is 11 % worse than odometry.")
    better = {"of": "tracked", "error_cm": {"before": 2.0, "after": 1.0}}
    said = verdict(CLOSED, (), ONE, better)
    assert said.startswith("It worked: ") and "50 % better than our own tracking" in said
    assert "trajectory" not in verdict(CLOSED, (), ONE, {"of": "odometry", "error_cm": None})


@pytest.mark.parametrize(
    ("ms", "sigma_ms", "found"), [(63.0, 4.0, True), (-63.0, 4.0, True), (26.0, 4.0, False), (63.0, 20.0, False)]
)
def test_depth_that_shows_another_moment_than_its_picture_is_found(ms: float, sigma_ms: float, found: bool) -> None:
    findings = find({"frames": 9, "constraints": [{}], "depth_lag": {"ms": ms, "sigma_ms": sigma_ms}})
    assert [finding.anchor for finding in findings] == (["streams-apart"] if found else [])
    assert not found or ("before" if ms > 0 else "after") in findings[0].text


def test_what_was_found_of_the_stream_is_the_cause_before_all_others() -> None:
    row = {"what": "depth is of another scale", "cause": "steps", "todo": "record mm", "anchor": "depth-scale"}
    findings = find({"frames": 9, "constraints": [], "detections": 9, "objects": 9, "stream": [row]})
    assert [finding.anchor for finding in findings] == ["depth-scale"] and "record mm" in findings[0].text
