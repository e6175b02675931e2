# SPDX-License-Identifier: Apache-2.0
"""Tied sessions in one frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_tools.report.store.store_summary import survey
from objreg_tools.report.store.tied_map import tied_maps
from report.places import at, cup_and_book, store_of, tying


def test_tied_sessions_are_in_the_frame_of_the_oldest_with_their_ties(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0)), (3.0, 2, at(0.0))]
    (one,) = tied_maps(survey(store_of(tmp_path / "s.db", shown, [tying(1.0, 2.0, 0, 1, 0.5)])))
    assert one.sessions == (0, 1) and one.axes == ("x", "z")
    (first, path), (second, moved_path) = one.trajectories
    assert (first, second) == (0, 1) and moved_path[0] - path[0] == pytest.approx(np.array([0.5, 0.0]))
    ((earlier, later, here, there),) = one.ties
    assert (earlier, later) == (0, 1) and there - here == pytest.approx(np.array([0.5, 0.0]))


def test_an_object_is_where_it_was_seen_last(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.3))]
    found = survey(store_of(tmp_path / "s.db", shown, [tying(1.0, 2.0, 0, 1, 0.5)]))
    (one,) = tied_maps(found)
    cups = [place for place in one.places if place.label == "cup"]
    assert len(one.places) == len(found.landmarks) and max(place.xy[0] for place in cups) == pytest.approx(
        0.8, abs=0.01
    )
    assert sum(place.sightings for place in one.places) == 4
    assert np.isfinite(one.points).all()


def test_sessions_without_a_tie_have_no_map_together(tmp_path: Path) -> None:
    assert tied_maps(survey(cup_and_book(tmp_path / "s.db"))) == []
