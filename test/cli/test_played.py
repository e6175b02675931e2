# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import pytest
from recording.sample_folders import noetic_bag, tum_folder

from objreg_tools.cli.played import as_rosbag2
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import Inputs

INPUTS = Inputs(image="/image", depth="/depth/image", camera_info="/camera_info")


def test_a_folder_of_pictures_becomes_a_rosbag2_once(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    bag = as_rosbag2(folder, INPUTS, tmp_path / "out", seconds=0.15)
    with open_recording(bag) as source:
        assert source.kind.startswith("rosbag2") and source.topics["/image"].count == 2
    written = (bag / "metadata.yaml").stat().st_mtime_ns
    assert as_rosbag2(folder, INPUTS, tmp_path / "out", seconds=0.15) == bag
    assert (bag / "metadata.yaml").stat().st_mtime_ns == written
    assert as_rosbag2(bag, INPUTS, tmp_path / "out", seconds=None) == bag


def copied(recording: Path, out: Path, inputs: Inputs = INPUTS) -> Path:
    return as_rosbag2(recording, inputs, out, seconds=None)


def test_a_copy_that_is_played_again_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = copied(tum_folder(tmp_path / "run"), tmp_path / "out")
    assert f"writing {tmp_path / 'run'} as {bag}" in capsys.readouterr().err
    copied(tmp_path / "run", tmp_path / "out")
    assert f"playing {bag}, which an earlier run wrote of {tmp_path / 'run'}" in capsys.readouterr().err


def test_recordings_of_one_name_have_copies_of_their_own(tmp_path: Path) -> None:
    places = [tmp_path / "a" / "run", tmp_path / "b" / "run", tmp_path / "b" / "run.1", tmp_path / "b" / "run.2"]
    assert len({copied(tum_folder(place), tmp_path / "out") for place in places}) == 4


def test_a_recording_that_has_changed_is_copied_anew(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "run")
    before = copied(folder, tmp_path / "out")
    os.utime(folder / "rgb/0.000000.png", ns=(0, time.time_ns() + 10**9))
    assert copied(folder, tmp_path / "out") != before


def test_other_inputs_of_a_recording_are_copied_anew(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "run")
    truth = replace(INPUTS, ground_truth="/ground_truth")
    assert copied(folder, tmp_path / "out") != copied(folder, tmp_path / "out", truth)


def test_a_copy_within_the_recordings_own_folder_is_played_again(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "run")
    assert copied(folder, folder / "out") == copied(folder, folder / "out")


def test_of_a_rosbag1_only_the_inputs_are_written(tmp_path: Path) -> None:
    bag = as_rosbag2(noetic_bag(tmp_path / "one.bag"), INPUTS, tmp_path / "out", seconds=None)
    with open_recording(bag) as source:
        assert set(source.topics) == {"/image", "/depth/image", "/camera_info"}


def test_a_failed_try_leaves_nothing(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    (folder / "depth/0.200000.png").write_bytes(b"")
    with pytest.raises(ValueError, match=r"0\.200000\.png"):
        as_rosbag2(folder, INPUTS, tmp_path / "out", seconds=None)
    assert list((tmp_path / "out").iterdir()) == []
