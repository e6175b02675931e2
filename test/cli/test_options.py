# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.cli.options import require_writable


def test_a_file_that_can_be_written_is_not_touched(tmp_path: Path) -> None:
    require_writable("--out", tmp_path / "new.html")
    assert not (tmp_path / "new.html").exists()
    (tmp_path / "old.html").write_text("old")
    require_writable("--out", tmp_path / "old.html")
    assert (tmp_path / "old.html").read_text() == "old"


def test_a_file_in_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a_file").touch()
    for place in (tmp_path / "nowhere/x", tmp_path / "a_file/x"):
        with pytest.raises(OSError, match=r"^--out: expected .* to be a folder, and it is not; create it or choose"):
            require_writable("--out", place)


def test_a_file_that_may_not_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old").touch()
    for forbidden, file in ((tmp_path, tmp_path / "new"), (tmp_path / "old", tmp_path / "old")):
        monkeypatch.setattr("os.access", lambda path, mode, forbidden=forbidden: path != forbidden)  # as root may
        with pytest.raises(OSError, match=r"^--out: expected to be allowed to write .*, and am not; choose another"):
            require_writable("--out", file)
