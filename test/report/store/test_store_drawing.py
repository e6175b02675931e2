# SPDX-License-Identifier: Apache-2.0
"""A store as one picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from registration.samples import box

from objreg_ros.memory.store import Store
from objreg_tools.report.store.portraits import TILE, portraits
from objreg_tools.report.store.store_drawing import CAPTION, MOVED, PANEL, draw
from objreg_tools.report.store.store_summary import survey
from report.places import at, closure_of_move, cup_and_book, store_of


def test_every_session_has_a_panel_and_the_objects_are_below(tmp_path: Path) -> None:
    objects = (box("cup", (0, 0, 1)),)
    file = store_of(tmp_path / "s.db", [(float(k), k, objects) for k in range(6)])
    found = survey(file)
    picture = draw(found, portraits(file, found.sightings))
    assert picture.dtype == np.uint8 and picture.shape[1] == 2 * PANEL
    assert picture.shape[0] > 3 * PANEL + TILE + CAPTION
    for k in range(6):
        top, left = PANEL * (k // 2), PANEL * (k % 2)
        assert (picture[top : top + PANEL, left : left + PANEL] != 255).any()


def test_many_sessions_stay_within_what_a_viewer_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_tools.report.store.store_drawing.TALLEST", 1000)
    file = store_of(tmp_path / "s.db", [(float(k), k, (box("cup", (0, 0, 1)),)) for k in range(10)])
    assert draw(survey(file), {}).shape[0] < 1000 + 100


def test_a_moved_object_has_an_arrow(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 0, at(0.4))]
    still = survey(store_of(tmp_path / "a.db", shown))
    moved = survey(store_of(tmp_path / "b.db", shown, [closure_of_move(1.0, 2.0)]))
    assert not (draw(still, {}) == MOVED).all(axis=2).any() and (draw(moved, {}) == MOVED).all(axis=2).sum() > 50


def test_a_landmark_without_a_picture_is_not_on_the_sheet(tmp_path: Path) -> None:
    found = survey(cup_and_book(tmp_path / "s.db"))
    one = {found.landmarks[0].landmark: np.full((TILE, TILE, 3), 7, np.uint8)}
    assert draw(found, one).shape[0] - draw(found, {}).shape[0] == TILE + CAPTION


def test_an_empty_store_has_a_picture_too(tmp_path: Path) -> None:
    Store(tmp_path / "empty.db").close()
    assert draw(survey(tmp_path / "empty.db"), {}).shape == (PANEL, PANEL, 3)
