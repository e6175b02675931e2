# SPDX-License-Identifier: Apache-2.0
"""A session from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_tools.report.store.session_map import session_maps
from objreg_tools.report.store.store_summary import survey
from report.places import at, closure_of_move, cup_and_book, store_of


def test_every_session_has_a_map_with_what_it_saw(tmp_path: Path) -> None:
    maps = session_maps(survey(cup_and_book(tmp_path / "s.db")))
    assert [one.session for one in maps] == [0, 1]
    assert [(place.label, place.sightings) for place in maps[0].places] == [("cup", 2), ("book", 2)]
    assert maps[0].places[0].landmark != maps[1].places[0].landmark


def test_a_map_leaves_out_the_axis_of_least_spread(tmp_path: Path) -> None:
    one = session_maps(survey(cup_and_book(tmp_path / "s.db")))[0]
    assert one.axes == ("x", "z")
    assert one.places[1].xy == pytest.approx(np.array([0.5, 1.0]), abs=0.01)
    assert one.points.shape == (len(one.trajectory) + 2, 2)


def test_a_move_is_on_the_map_of_the_session_that_saw_it(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.4))]
    before, after = session_maps(survey(store_of(tmp_path / "s.db", shown, [closure_of_move(1.0, 2.0)])))
    assert before.moves == ()
    ((label, stood, stands),) = after.moves
    assert label == "cup" and stands - stood == pytest.approx(np.array([0.4, 0.0]), abs=1e-6)
