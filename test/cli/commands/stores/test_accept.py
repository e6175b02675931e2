# SPDX-License-Identifier: Apache-2.0
"""`objreg accept` on a store."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from registrar.test_registrar import AWAY, BESIDE, HERE, PARAMS, _frame, _run
from report.places import at, store_of

from objreg_ros.data.closure_id import closure_id
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.memory.store import Store
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.cli import group
from objreg_tools.cli.commands.stores import accept as module

SECOND = 1_000_000_000


def accept(*words: object) -> str:
    return CliRunner().invoke(group, ["accept", *map(str, words)], catch_exceptions=False, standalone_mode=False).output


def test_the_pose_is_that_of_registration_and_the_closure_says_that_it_is_by_hand(tmp_path: Path) -> None:
    place = tmp_path / "place.db"
    with closing(Registrar(PARAMS.replaced(store=str(place)))) as registrar:
        _run(registrar, _frame(0, HERE, True), _frame(1, AWAY, True), _frame(30, BESIDE, True))
        found = list(registrar.veto([closure_id(one) for one in registrar._store.closures()]).withdrawn)
    with pytest.raises(ValueError, match="nobody withdrew"):
        accept(place, found[0].from_ns, found[0].to_ns)
    with closing(Store(place)) as opened:
        for veto in opened.vetoes():
            opened.undo_veto([veto])
    with pytest.raises(ValueError, match="without a closure"):
        accept(place, found[0].to_ns, found[0].from_ns)


def test_where_registration_finds_no_pose_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = store_of(tmp_path / "place.db", [(10.0, 0, at(0.0)), (30.0, 1, at(0.0))])
    with pytest.raises(ValueError, match="expected one keyframe at 5 ns, got 0"):
        accept(place, 5, 10 * SECOND)
    monkeypatch.setattr(module, "align", lambda *_: SimpleNamespace(candidate=None, detail="nothing is alike"))
    with pytest.raises(ValueError, match="a pose between them, got none: nothing is alike"):
        accept(place, 10 * SECOND, 30 * SECOND)
    with closing(Store(place, read_only=True)) as opened:
        assert list(opened.closures()) == []


def test_what_nobody_closed_is_closed_by_hand(tmp_path: Path) -> None:
    place = tmp_path / "place.db"
    with closing(Registrar(PARAMS.replaced(store=str(place), least_odds=1e6, confirm_seconds=0.0))) as registrar:
        closures, _ = _run(registrar, _frame(0, HERE, True), _frame(1, AWAY, True), _frame(30, BESIDE, True))
        assert closures == []
    with pytest.raises(ValueError, match="expected two keyframes, got the one at 30000000000 ns twice"):
        accept(place, 30 * SECOND, 30 * SECOND)
    accept(place, 0, 30 * SECOND)
    with closing(Store(place, read_only=True)) as opened:
        (closure,) = opened.closures()
    degrees, centimetres = pose_error(closure.T_from_to, inverse(HERE) @ BESIDE)
    assert closure.evidence["by hand"] == 1.0 and degrees < 1.0 and centimetres < 2.0
