# SPDX-License-Identifier: Apache-2.0
"""A file is written whole, or what was there stays."""

from __future__ import annotations

import errno
import os
import stat
import threading
from pathlib import Path

import pytest

from objreg_ros.whole_file import folder_for, put_whole, whole_file, write_whole


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_texts_and_bytes_are_written_and_nothing_else_is_left(tmp_path: Path) -> None:
    write_whole(tmp_path / "text", "größer\n")
    write_whole(tmp_path / "name", os.fsdecode(b"r\xfcm"))
    write_whole(tmp_path / "bytes", b"\x00\xff")
    assert (tmp_path / "text").read_bytes() == "größer\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff"
    assert (tmp_path / "name").read_bytes() == b"r?m"
    assert names(tmp_path) == ["bytes", "name", "text"]


@pytest.mark.parametrize("broken", [ValueError, KeyboardInterrupt])
def test_what_was_there_stays_until_the_new_is_whole(tmp_path: Path, broken: type[BaseException]) -> None:
    file = tmp_path / "file"
    file.write_text("old")
    with pytest.raises(broken), whole_file(file) as part:
        part.write(b"half of the n")
        part.flush()
        assert file.read_text() == "old"
        raise broken
    assert file.read_text() == "old" and names(tmp_path) == ["file"]


def test_a_full_disk_is_named_with_the_file_and_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_text("old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match=rf"^{file}: expected .*, got: No space left on device; make room"):
        write_whole(file, "new")
    assert file.read_text() == "old" and names(tmp_path) == ["file"]


def test_a_device_that_is_full_is_named_and_stays_a_device() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OSError, match=r"^/dev/full: expected .*, got: No space left on device; make room"):
        write_whole(full, "new")
    assert stat.S_ISCHR(full.stat().st_mode)


def test_a_folder_that_there_is_not_and_one_in_the_files_place_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere/file: expected .*, got: No such file or directory"):
        write_whole(tmp_path / "nowhere/file", "")
    with pytest.raises(IsADirectoryError, match=f"^{tmp_path}: expected .*, got: Is a directory"):
        write_whole(tmp_path, "")


def test_a_link_stays_a_link_and_permissions_stay_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "real").chmod(0o640)
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"
    assert stat.S_IMODE((tmp_path / "real").stat().st_mode) == 0o640


def test_a_new_file_has_the_permissions_that_any_new_file_has(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write_whole(tmp_path / "file", "")
    assert (tmp_path / "file").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_pipe_is_written_into(tmp_path: Path) -> None:
    pipe, received = tmp_path / "pipe", list[str]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_text()))
    reader.start()
    write_whole(pipe, "written")
    reader.join(60)
    assert received == ["written"] and names(tmp_path) == ["pipe"]


def test_links_in_a_circle_are_named_and_stay(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(OSError, match=rf"^{tmp_path}/circle: expected .*, got: Too many levels of symbolic links"):
        write_whole(tmp_path / "circle", "new")
    assert (tmp_path / "circle").is_symlink() and names(tmp_path) == ["circle"]


def made(path: Path) -> None:
    """Make a file elsewhere and put it to its place."""
    with folder_for(path) as folder:
        (folder / "part").write_text("new")
        put_whole(folder / "part", path)


def test_what_is_made_elsewhere_takes_the_place_behind_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    made(tmp_path / "link")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"
    assert names(tmp_path) == ["link", "real"]


def test_what_is_made_elsewhere_is_written_into_a_pipe_which_stays_one(tmp_path: Path) -> None:
    pipe, received = tmp_path / "pipe", list[str]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_text()), daemon=True)
    reader.start()
    made(pipe)
    reader.join(60)
    assert received == ["new"] and stat.S_ISFIFO(pipe.stat().st_mode) and names(tmp_path) == ["pipe"]


def test_what_is_made_elsewhere_names_the_place_that_takes_nothing(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError, match=f"^{tmp_path}/folder: expected .*, got: Is a directory"):
        made(tmp_path / "folder")
