# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
from pathlib import Path

import pytest

from objreg_tools.recording.folders.text import read_text, require_regular


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_text_is_read_with_and_without_a_byte_order_mark(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text("# café\n", encoding=encoding)
    assert read_text(tmp_path / "list.txt") == "# café\n"


def test_another_encoding_is_refused_with_the_name_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_bytes("# café\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"list\.txt: expected text in UTF-8, got byte 0xe9 at 5"):
        read_text(tmp_path / "list.txt")


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "list.txt")
    for place, got in (
        (tmp_path / "list.txt", r"a pipe \(FIFO\)"),
        (Path("/dev/zero"), "a device"),
        (tmp_path, "a folder"),
    ):
        with pytest.raises(ValueError, match=rf"expected a regular file, got {got}; put a copy"):
            read_text(place)


def test_a_text_that_is_too_long_is_refused_unread(tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text("12345")
    assert read_text(tmp_path / "list.txt", 5) == "12345" and require_regular(tmp_path / "list.txt") == 5
    with pytest.raises(ValueError, match=r"list\.txt: expected at most 4 bytes of text, got 5"):
        read_text(tmp_path / "list.txt", 4)
