# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from recording.folders import noetic_bag, tum_folder

from objreg_ros.cli.played import as_rosbag2
from objreg_ros.recording import open_recording
from objreg_ros.recording.inputs import Inputs

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


def test_of_a_rosbag1_only_the_inputs_are_written(tmp_path: Path) -> None:
    bag = as_rosbag2(noetic_bag(tmp_path / "one.bag"), INPUTS, tmp_path / "out", seconds=None)
    with open_recording(bag) as source:
        assert set(source.topics) == {"/image", "/depth/image", "/camera_info"}


def test_a_failed_try_leaves_nothing(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    (folder / "depth/0.200000.png").write_bytes(b"")
    with pytest.raises(OSError, match=r"0\.200000\.png"):
        as_rosbag2(folder, INPUTS, tmp_path / "out", seconds=None)
    assert list((tmp_path / "out").iterdir()) == []
