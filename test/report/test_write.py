# SPDX-License-Identifier: Apache-2.0
"""From files to the page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording.sample_folders import lost, records

from objreg_tools.recording import write_rosbag2
from objreg_tools.recording.inputs import Inputs
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.write import write_report

from .runs import summary


def test_a_report_is_written_from_json_alone(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps(summary()))
    lacking = write_report(tmp_path / "out.html", [tmp_path / "run.json"] * 2)
    assert len(lacking) == 2 and "names a recording that is not there" in lacking[0]
    assert (tmp_path / "out.html").read_text().count("<article ") == 2


def test_the_recording_of_a_run_gives_truth_and_pictures(tmp_path: Path, shared: Path) -> None:
    place = shared / "data" / "redkitchen_a"
    (tmp_path / "run.json").write_text(json.dumps({**summary(), "recording": str(place)}))
    assert write_report(tmp_path / "out.html", [tmp_path / "run.json"]) == []
    text = (tmp_path / "out.html").read_text()
    assert "<h1>redkitchen_a</h1>" in text and text.count("data:image/webp") >= 12


def test_the_json_of_a_live_run_is_shown_by_the_odometry_of_its_recording(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records(30))
    counters = {"published": 29, "stage_ms": {"segment": [3.0, 5.0]}}
    run = {"recording": str(tmp_path / "bag"), "constraints": [], "rejected": {}, "nodes": {"segmenter": counters}}
    (tmp_path / "demo.json").write_text(json.dumps(run))
    write_report(tmp_path / "out.html", [tmp_path / "demo.json"])
    text = (tmp_path / "out.html").read_text()
    assert "the camera trajectory from above" in text and "segmenter: segment" in text
    assert ">29<" in text


def test_frames_without_a_pose_get_that_of_the_odometry_at_their_time(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records(30))
    stamps = [record.stamp_ns for record in records(30) if record.topic == "/odom"]
    seen = [{"stamp_ns": stamp + 1_000_000, "labels": ["cup"], "objects": [["cup", [0, 0, 1]]]} for stamp in stamps]
    run = {"recording": str(tmp_path / "bag"), "constraints": [], "glimpses": [*seen, {"stamp_ns": 5}]}
    (tmp_path / "demo.json").write_text(json.dumps(run))
    write_report(tmp_path / "out.html", [tmp_path / "demo.json"])
    text = (tmp_path / "out.html").read_text()
    assert "Object map" in text and "cup, " in text


def test_odometry_that_is_no_pose_is_passed_over(tmp_path: Path) -> None:
    some_lost = [lost(record) if record.topic == "/odom" and i < 9 else record for i, record in enumerate(records(30))]
    write_rosbag2(tmp_path / "bag", some_lost)
    run = {"recording": str(tmp_path / "bag"), "constraints": [], "rejected": {}}
    (tmp_path / "demo.json").write_text(json.dumps(run))
    write_report(tmp_path / "out.html", [tmp_path / "demo.json"])
    assert "the camera trajectory from above" in (tmp_path / "out.html").read_text()


def test_a_camera_that_is_mounted_on_the_body_of_the_odometry_is_placed_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[RunSummary] = []
    monkeypatch.setattr("objreg_tools.report.write.page", lambda loaded, last: shown.append(loaded[0][0]) or "")
    write_rosbag2(tmp_path / "bag", records(3))
    rows = [{"stamp_ns": record.stamp_ns, "labels": [], "objects": []} for record in records(3)][::4]
    mounted = [0.3, 0.0, 1.1, -0.5, 0.5, -0.5, 0.5]  # looks ahead: optical z is the body's x
    run = {"recording": str(tmp_path / "bag"), "constraints": [], "glimpses": rows, "T_base_camera": mounted}
    (tmp_path / "demo.json").write_text(json.dumps(run))
    write_report(tmp_path / "out.html", [tmp_path / "demo.json"])
    for k, glimpse in enumerate(shown[0].glimpses):
        metre_ahead = glimpse.T_odom_camera @ [0.0, 0.0, 1.0, 1.0]
        assert np.allclose(metre_ahead[:3], [0.1 * k + 0.3 + 1.0, 0.0, 1.1])


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> list[Inputs]:
    """What the pictures of a report are taken from."""
    seen: list[Inputs] = []
    monkeypatch.setattr("objreg_tools.report.write.Album", lambda recording, inputs, *_: seen.append(inputs))
    return seen


def test_the_pictures_are_of_the_inputs_that_the_run_took(tmp_path: Path, chosen: list[Inputs]) -> None:
    other = [replace(record, topic=f"/other{record.topic}") for record in records(3)]
    write_rosbag2(tmp_path / "bag", [*records(3), *other])
    taken = Inputs(image="/other/image", depth="/other/depth/image", camera_info="/other/camera_info")
    for inputs in (taken.outright, {**taken.outright, "odom": "/drifting_odom"}):
        run = {"recording": str(tmp_path / "bag"), "inputs": inputs, "constraints": [], "name": "a walk"}
        (tmp_path / "run.json").write_text(json.dumps(run))
        write_report(tmp_path / "out.html", [tmp_path / "run.json"])
    assert chosen == [taken, taken] and "<h1>a walk</h1>" in (tmp_path / "out.html").read_text()


def test_an_older_json_that_does_not_name_its_inputs_is_shown_by_what_would_be_taken(
    tmp_path: Path, chosen: list[Inputs]
) -> None:
    write_rosbag2(tmp_path / "bag", records(3))
    (tmp_path / "run.json").write_text(json.dumps({"recording": str(tmp_path / "bag"), "constraints": []}))
    write_report(tmp_path / "out.html", [tmp_path / "run.json"])
    assert [(inputs.image, inputs.odom) for inputs in chosen] == [("/image", "/odom")]


@pytest.mark.parametrize("text", ["", "[1]", '{"frames": 3}'])
def test_what_is_no_run_is_refused_by_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(ValueError, match=r"run\.json: expected the JSON of `objreg offline --json`"):
        write_report(tmp_path / "out.html", [tmp_path / "run.json"])


@pytest.mark.parametrize("key", ["constraints", "refusals", "glimpses"])
def test_a_number_in_the_place_of_a_list_is_refused_by_the_name_of_its_file(tmp_path: Path, key: str) -> None:
    (tmp_path / "run.json").write_text(json.dumps({"constraints": [], "recording": str(tmp_path), key: 3}))
    with pytest.raises(
        ValueError, match=rf"run\.json: expected {key} to be a list of .*, got 3; run objreg offline again"
    ):
        write_report(tmp_path / "page.html", [tmp_path / "run.json"])
