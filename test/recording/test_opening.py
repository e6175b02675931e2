# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
from pathlib import Path

import pytest

from objreg_tools.recording import open_recording, write_rosbag2

from .sample_folders import records, tum_folder


def test_nothing_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such file or folder; expected a rosbag1 file"):
        open_recording(tmp_path / "nothing")


def test_a_picture_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "cat.jpg").write_bytes(b"")
    with pytest.raises(ValueError, match=r"got a file \.jpg"):
        open_recording(tmp_path / "cat.jpg")


def test_a_folder_of_something_else_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(ValueError, match=r"got a folder with notes\.txt"):
        open_recording(tmp_path)


def test_a_path_may_be_text(tmp_path: Path) -> None:
    assert open_recording(str(tum_folder(tmp_path))).kind == "TUM RGB-D folder"


@pytest.mark.parametrize("suffix", [".bag", ".mcap", ".db3"])
def test_what_is_no_file_is_not_waited_for(suffix: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / f"x{suffix}")
    with pytest.raises(ValueError, match=r"expected a regular file, got a pipe"):
        open_recording(tmp_path / f"x{suffix}")


@pytest.mark.parametrize("name", ["metadata.yaml", "bag.mcap"])
def test_a_pipe_in_a_bag_is_not_waited_for(name: str, tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    (tmp_path / "bag" / name).unlink()
    os.mkfifo(tmp_path / "bag" / name)
    with pytest.raises(ValueError, match=rf"{name}: expected a regular file, got a pipe"):
        open_recording(tmp_path / "bag")


def test_text_with_the_name_of_a_record3d_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.r3d").write_text("hello")
    with pytest.raises(ValueError, match=r"a\.r3d: expected a ZIP as Record3D exports it"):
        open_recording(tmp_path / "a.r3d")
