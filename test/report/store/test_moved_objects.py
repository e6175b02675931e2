# SPDX-License-Identifier: Apache-2.0
"""When which objects were moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.memory.store import Store
from objreg_tools.report.store.moved_objects import Moves, moves_in
from report.places import at, closure_of_move, store_of


def moves_of(file: Path) -> Moves:
    store = Store(file, read_only=True)
    try:
        return moves_in(store, tuple(store.sightings()))
    finally:
        store.close()


def test_a_closure_states_between_which_keyframes_what_went_from_where_to_where(tmp_path: Path) -> None:
    file = store_of(tmp_path / "s.db", [(1.0, 0, at(0.0)), (2.0, 1, at(0.4))], [closure_of_move(1.0, 2.0)])
    (move,) = moves_of(file).known
    assert (move.there.keyframe_id, move.here.keyframe_id, move.there.label) == (1, 2, "cup")
    assert (move.there.session, move.here.session, move.closures) == (0, 1, 1)
    assert move.nearest.here.position - move.nearest.stood == pytest.approx(np.array([0.4, 0, 0]), abs=1e-6)


def test_several_closures_bound_one_move(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 0, at(0.0)), (3.0, 0, at(0.4)), (4.0, 0, at(0.4))]
    file = store_of(
        tmp_path / "s.db", shown, [closure_of_move(1.0, 3.0), closure_of_move(2.0, 4.0), closure_of_move(1.0, 4.0)]
    )
    (move,) = moves_of(file).known
    assert (move.there.keyframe_id, move.here.keyframe_id, move.closures) == (2, 3, 3)


def test_what_went_there_and_back_was_moved_twice(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 0, at(0.4)), (3.0, 0, at(0.4)), (4.0, 0, at(0.0))]
    moves = moves_of(store_of(tmp_path / "s.db", shown, [closure_of_move(1.0, 2.0), closure_of_move(3.0, 4.0)])).known
    assert [(move.there.keyframe_id, move.here.keyframe_id) for move in moves] == [(1, 2), (3, 4)]


@pytest.mark.parametrize(
    "closure",
    [closure_of_move(1.0, 9.0), closure_of_move(1.0, 2.0, metres=0.3), closure_of_move(1.0, 2.0, label="bowl")],
)
def test_what_fits_nothing_that_is_stored_is_counted_and_not_guessed(tmp_path: Path, closure: object) -> None:
    file = store_of(tmp_path / "s.db", [(1.0, 0, at(0.0)), (2.0, 0, at(0.4))], [closure])  # type: ignore[list-item]
    assert moves_of(file) == Moves((), 1)


def test_a_store_in_which_nothing_moved_has_no_move(tmp_path: Path) -> None:
    assert moves_of(store_of(tmp_path / "s.db", [(1.0, 0, at(0.0))])) == Moves()
