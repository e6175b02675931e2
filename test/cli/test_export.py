# SPDX-License-Identifier: Apache-2.0
"""`objreg inspect` and `objreg export` on a store."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from objreg_ros.cli import export, inspect
from objreg_ros.memory.store import Store


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


def test_a_damaged_keyframe_is_named_and_the_others_are_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(store: Path, folder: Path, tell: Callable[[str], None]) -> Iterator[Path]:
        tell("keyframe 5 is left out: damaged")
        yield folder / "map.json"

    monkeypatch.setattr("objreg_ros.cli.export.export", damaged)
    result = CliRunner().invoke(export.command, ["place.db", str(tmp_path / "out")], catch_exceptions=False)
    assert result.exit_code == 0 and "! keyframe 5 is left out: damaged" in result.output
