# SPDX-License-Identifier: Apache-2.0
"""`objreg inspect` and `objreg export` on a store."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from recording.sample_folders import tum_folder
from report.places import cup_and_book

from objreg_ros.memory.store import Store
from objreg_tools.cli import group
from objreg_tools.cli.commands import inspect
from objreg_tools.cli.commands.stores import export


def test_a_store_is_described_drawn_and_written_as_a_page(tmp_path: Path) -> None:
    place, picture, page = cup_and_book(tmp_path / "place.db"), tmp_path / "map.png", tmp_path / "map.html"
    words = [str(place), "--picture", str(picture), "--page", str(page)]
    result = CliRunner().invoke(inspect.command, words, catch_exceptions=False)
    assert result.exit_code == 0 and "3 keyframes" in result.output and "no picture" not in result.output
    assert picture.stat().st_size > 0 and "Session 1" in page.read_text()


@pytest.mark.parametrize("option", ["--picture", "--page"])
def test_what_draws_a_store_asks_for_one_and_for_a_place_that_takes_a_file(option: str, tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    with pytest.raises(OSError, match=f"{option}: expected an existing folder"):
        words = ["inspect", str(tmp_path / "place.db"), option, str(tmp_path / "no" / "x")]
        CliRunner().invoke(group, words, catch_exceptions=False)
    with pytest.raises(ValueError, match=f"{option}: expected a store"):
        CliRunner().invoke(
            inspect.command, [str(tum_folder(tmp_path / "tum")), option, str(tmp_path / "x")], catch_exceptions=False
        )


def test_a_store_is_exported(tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    arguments = [str(tmp_path / "place.db"), str(tmp_path / "out")]
    result = CliRunner().invoke(export.command, arguments, catch_exceptions=False)
    assert result.exit_code == 0 and (tmp_path / "out" / "map.json").is_file()
    assert "wrote 1 files into" in result.output


def test_a_damaged_keyframe_is_named_and_the_others_are_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(store: Path, folder: Path, notify: Callable[[str], None], grid: object) -> Iterator[Path]:
        notify("keyframe 5 is left out: damaged")
        yield folder / "map.json"

    monkeypatch.setattr("objreg_tools.cli.commands.stores.export.export", damaged)
    result = CliRunner().invoke(export.command, ["place.db", str(tmp_path / "out")], catch_exceptions=False)
    assert result.exit_code == 0 and "! keyframe 5 is left out: damaged" in result.output
