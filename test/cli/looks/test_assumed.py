# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from recording.sample_folders import tum_folder
from recording.vision import detected_bag

from objreg_tools.cli.looks.assumed import REGISTERED, assumed
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings
from objreg_tools.offline.run import Run


def rows(recording: Path, changes: tuple[str, ...] = (), **given: object) -> dict[str, str]:
    asked = RecordedOptions(read_settings(None, changes), **given)  # type: ignore[arg-type]
    with asked.opened(recording) as opened:
        return assumed(opened, Run())


def test_of_a_folder_its_files_are_named_and_the_steps_of_its_depth(tmp_path: Path) -> None:
    known = rows(tum_folder(tmp_path / "tum", scale=2000))
    assert known["colour"] == "rgb/" and known["depth"] == "depth/, 2000 steps in a metre"
    assert known["camera"] == "64 × 48, fx 50.0 fy 50.0 cx 31.5 cy 23.5, by camera.yaml"
    assert known["registration"] == REGISTERED and known["truth"].startswith("3 poses over 1.0 m")
    assert known["odometry"] == "none: the registrar tracks the camera itself"


def test_a_camera_that_is_given_is_named_as_that(tmp_path: Path) -> None:
    known = rows(tum_folder(tmp_path / "tum"), ("segmenter.camera=60,60,31.5,23.5",))
    assert known["camera"].endswith("by --camera") and "fx 60.0" in known["camera"]


def test_a_folder_without_a_camera_says_that_the_default_is_taken(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    (folder / "camera.yaml").unlink()
    assert "no camera.yaml: the default camera" in rows(folder)["camera"]


def test_the_model_is_named_with_why_it_was_taken(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    asked = rows(folder, ("detector.model=objreg_ssd.onnx", "detector.threshold=0.3"))
    assert asked["model"] == "objreg_ssd.onnx, as asked for; scores from 0.3 on"
    its_own = rows(folder, ("detector.model=objreg_ssd.onnx",))
    assert its_own["model"].endswith("scores from 0.5 on")


def test_of_a_bag_topics_and_the_unit_of_depth_are_named(tmp_path: Path) -> None:
    known = rows(detected_bag(tmp_path / "bag", frames=2), detections="/yolo/detections")
    assert known["model"] == "none: detections as recorded on /yolo/detections"
    assert known["depth"].endswith((" in mm", " in m")) and known["truth"]


def test_odometry_that_is_none_or_made_is_said_to_be(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    assert rows(folder, odometry="none")["odometry"] == "none, as asked for: no trajectory"
    assert rows(folder, odometry="drift:1")["odometry"] == "synthetic, which drifts from the truth"
