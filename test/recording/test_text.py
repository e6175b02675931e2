# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.recording.text import read_text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_text_is_read_with_and_without_a_byte_order_mark(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text("# café\n", encoding=encoding)
    assert read_text(tmp_path / "list.txt") == "# café\n"


def test_another_encoding_is_refused_with_the_name_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_bytes("# café\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"list\.txt: expected text in UTF-8, got byte 0xe9 at 5"):
        read_text(tmp_path / "list.txt")
