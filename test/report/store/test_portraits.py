# SPDX-License-Identifier: Apache-2.0
"""Small pictures of objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from registration.samples import box

from objreg_tools.report.store.portraits import TILE, portraits
from objreg_tools.report.store.store_summary import survey
from report.places import cup_and_book, store_of


def test_each_landmark_has_a_picture_with_its_colour_upon_the_view(tmp_path: Path) -> None:
    file = cup_and_book(tmp_path / "s.db")
    found = survey(file)
    drawn = portraits(file, found.sightings)
    assert drawn.keys() == {mark.landmark for mark in found.landmarks}
    picture = drawn[found.landmarks[0].landmark]
    assert picture.shape == (TILE, TILE, 3) and picture.dtype == np.uint8
    colour = np.array(40 + 60 * (len("cup") % 3))
    assert (picture[TILE // 3 : -TILE // 3, TILE // 3 : -TILE // 3] == colour).mean() > 0.3
    assert (picture[:4] != colour).any()


def test_those_seen_most_often_are_drawn_where_there_are_too_many(tmp_path: Path) -> None:
    cup, book = box("cup", (0, 0, 1)), box("book", (0.5, 0, 1), instance=2)
    file = store_of(tmp_path / "s.db", [(1.0, 0, (cup, book)), (2.0, 0, (book,))])
    found = survey(file)
    (often,) = [mark.landmark for mark in found.landmarks if mark.sightings == 2]
    assert list(portraits(file, found.sightings, most=1)) == [often]
