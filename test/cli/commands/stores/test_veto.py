# SPDX-License-Identifier: Apache-2.0
"""`objreg veto` on a store."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner
from report.places import at, store_of, tying

from objreg_ros.data.closure_id import closure_id
from objreg_ros.memory.store import Store
from objreg_tools.cli import group
from objreg_tools.cli.commands import inspect
from objreg_tools.cli.commands.stores import veto
from objreg_tools.report.store.store_page import store_page
from objreg_tools.report.store.store_summary import survey


def run(*words: str) -> str:
    result = CliRunner().invoke(veto.command, words, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return store_of(tmp_path / "place.db", [(10.0, 0, at(0.0)), (30.0, 1, at(0.0))], [tying(10.0, 30.0, 0, 1, 0.1)])


def test_a_closure_is_withdrawn_from_a_store_and_comes_back_with_its_id(place: Path) -> None:
    with closing(Store(place, read_only=True)) as opened:
        (closure,) = opened.closures()
    name = closure_id(closure)
    assert "withdrawn" in run(str(place), name)
    with closing(Store(place, read_only=True)) as opened:
        assert list(opened.closures()) == [] and opened.counts()["vetoed"] == 1
        (kept,) = opened.vetoes()
        assert all(stand is not None for stand in kept.stands) and opened.next_session() == 2
    assert name in CliRunner().invoke(inspect.command, [str(place)]).output
    assert name in store_page(survey(place), {})
    assert "holds again" in run(str(place), name, "--undo")
    with closing(Store(place, read_only=True)) as opened:
        (back,) = opened.closures()
        assert closure_id(back) == name and opened.vetoes() == []


def test_an_id_of_none_changes_nothing_and_a_robot_has_ids_of_its_own(place: Path) -> None:
    with closing(Store(place, read_only=True)) as opened:
        (closure,) = opened.closures()
    with pytest.raises(ValueError, match="stored closures, got nothing"):
        CliRunner().invoke(group, ["veto", str(place), closure_id(closure), "nothing"], catch_exceptions=False)
    with pytest.raises(ValueError, match="withdrawn closures"):
        CliRunner().invoke(group, ["veto", str(place), closure_id(closure), "--undo"], catch_exceptions=False)
    assert "withdrawn" in run(str(place), closure_id(closure, "r1"), "--robot", "r1")


def test_a_store_that_a_registrar_holds_and_a_file_that_is_not_there_are_one_line(place: Path, tmp_path: Path) -> None:
    with closing(Store(place)), pytest.raises(OSError, match=r"place\.db"):
        CliRunner().invoke(group, ["veto", str(place), "x"], catch_exceptions=False)
    with pytest.raises(OSError, match="expected"):
        CliRunner().invoke(group, ["veto", str(tmp_path / "no.db"), "x"], catch_exceptions=False)
