# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from recording.sample_folders import tum_folder
from recording.vision import detected_bag

from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings
from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.drift import with_drifting_odometry

NOTHING = {"model": None, "labels": None, "camera": "", "params_file": None, "changes": (), "remaps": ()}


def with_odometry(folder: Path) -> list[Record]:
    with open_recording(folder) as source:
        return list(with_drifting_odometry(source.records(), "/ground_truth", 1))


def test_named_options_are_settings_of_the_nodes() -> None:
    asked = RecordedOptions.of(**{**NOTHING, "labels": "names.txt"}, odometry=None, max_frames=None)
    assert asked.settings.changed() == {"detector.labels": "names.txt"}


def test_a_drift_without_a_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="expected drift: and a seed"):
        RecordedOptions.of(**NOTHING, odometry="drift:", max_frames=None)


def test_no_more_frames_are_expected_than_are_asked_for(tmp_path: Path) -> None:
    asked = RecordedOptions(read_settings(None, ()))
    folder = tum_folder(tmp_path, frames=4)
    with asked.opened(folder) as whole, replace(asked, max_frames=3).opened(folder) as part:
        assert (whole.frames, part.frames) == (4, 3) and whole.inputs.depth == "/depth/image"
        assert len(whole.notes) == 1 and "registrar's own tracking" in whole.notes[0]


def test_a_recording_without_odometry_is_tracked_unless_it_is_asked_for_none(tmp_path: Path) -> None:
    asked = RecordedOptions(read_settings(None, ()))
    folder = tum_folder(tmp_path, frames=2)
    known = []
    for odometry in (None, "tracked", "none", "drift:1"):
        with replace(asked, odometry=odometry).opened(folder) as opened:
            known.append((opened.odometry, len(opened.notes)))
    assert known == [("tracked", 1), ("tracked", 0), (None, 0), ("/drifting_odom", 0)]


def test_recorded_detections_are_run_without_the_detector(tmp_path: Path) -> None:
    asked = RecordedOptions(read_settings(None, ()), detections="/yolo/detections")
    with asked.opened(detected_bag(tmp_path / "bag", frames=2)) as opened:
        run = opened.run()
        summary = opened.summary(run, ())
    assert run.detections == 2 and "detect" not in run.stage_s and summary["detections_from"] == "/yolo/detections"
    assert [row["labels"] for row in summary["glimpses"]] == [["mug"]] * 2


def test_recorded_detections_that_nobody_asked_for_are_named_and_not_used(tmp_path: Path) -> None:
    asked, bag = RecordedOptions(read_settings(None, ())), detected_bag(tmp_path / "bag", frames=2)
    with asked.opened(bag) as opened, replace(asked, detections="/yolo/instance_masks").opened(bag) as other:
        (note,) = [note for note in opened.notes if "detections" in note]
        assert note.endswith("which are not used: --detections /yolo/detections takes them")
        assert opened.recorded is None and not [note for note in other.notes if "detections" in note]


def test_odometry_that_is_there_is_left_out_where_tracking_is_asked_for(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", with_odometry(tum_folder(tmp_path / "tum", frames=2)))
    asked = RecordedOptions(read_settings(None, ()))
    with asked.opened(tmp_path / "bag") as opened, replace(asked, odometry="tracked").opened(tmp_path / "bag") as other:
        assert (opened.odometry, opened.inputs.odom) == ("/drifting_odom", "/drifting_odom")
        assert (other.odometry, other.inputs.odom) == ("tracked", None)
