# SPDX-License-Identifier: Apache-2.0
"""`objreg inspect` and `objreg export` on a store."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from objreg_ros.cli import export, inspect
from objreg_ros.registrar.store import Store


def test_a_store_is_described_and_drawn(tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    result = CliRunner().invoke(
        inspect.command, [str(tmp_path / "place.db"), "--picture", str(tmp_path / "map.png")], catch_exceptions=False
    )
    assert result.exit_code == 0 and "0 keyframes" in result.output
    assert (tmp_path / "map.png").stat().st_size > 0


def test_a_store_is_exported(tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    arguments = [str(tmp_path / "place.db"), str(tmp_path / "out")]
    result = CliRunner().invoke(export.command, arguments, catch_exceptions=False)
    assert result.exit_code == 0 and (tmp_path / "out" / "map.json").is_file()
    assert "wrote 1 files into" in result.output
