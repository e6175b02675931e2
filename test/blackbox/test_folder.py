# SPDX-License-Identifier: Apache-2.0
"""The folder is bounded, and what is not of the black box stays."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from objreg_ros.blackbox.folder import Folder


def written(folder: Folder, stamp_ns: int, nbytes: int = 100) -> Path:
    path = folder.new_file(stamp_ns, "called", nbytes)
    path.write_bytes(bytes(nbytes))
    path.with_suffix(".yaml").write_text("{}")
    os.utime(path, ns=(stamp_ns, stamp_ns))
    return path


def test_the_oldest_files_go_with_their_parameters(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "made" / "here", most_bytes=250)
    paths = [written(folder, stamp * 10**9) for stamp in (3, 1, 5, 7)]  # each is as old as its number
    assert folder.files() == paths[2:] and folder.nbytes() == 200 and folder.removed == 2
    assert sorted(path.suffix for path in folder.path.iterdir()) == [".mcap", ".mcap", ".yaml", ".yaml"]


def test_what_is_not_of_the_black_box_is_never_removed(tmp_path: Path) -> None:
    mine, link = tmp_path / "objreg-mine.mcap", tmp_path / "objreg-0000000001.000000000-called.mcap"
    mine.write_bytes(bytes(1000))
    link.symlink_to(mine)
    folder = Folder(tmp_path, most_bytes=10)
    folder.new_file(2 * 10**9, "called", 100)
    assert mine.exists() and link.is_symlink() and folder.removed == 0


def test_two_files_of_one_stamp_have_two_names_and_both_are_of_the_box(tmp_path: Path) -> None:
    folder = Folder(tmp_path, most_bytes=10**6)
    assert written(folder, 10**9).name == "objreg-0000000001.000000000-called.mcap"
    assert written(folder, 10**9).name == "objreg-0000000001.000000000-called-2.mcap"
    assert len(folder.files()) == 2


def test_a_folder_that_cannot_be_made_is_an_error_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        Folder(tmp_path / "file" / "folder", 100).new_file(1, "called", 1)
