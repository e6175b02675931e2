# SPDX-License-Identifier: Apache-2.0
"""Tests of how twin places are counted."""

from __future__ import annotations

import numpy as np
from registration.samples import frame, moved, scene_view

from objreg_tools.simulation.scenarios import twins_of
from objreg_tools.simulation.world.twins import MIDDLE_X
from objreg_tools.truth import Truth

SECOND = 1_000_000_000


def test_a_recording_is_cut_where_the_camera_goes_from_one_place_to_the_other() -> None:
    from twins import visits

    xs = (-2.0, -1.0, 1.0, 2.0, -1.0)
    truth = Truth((k * SECOND, moved(x)) for k, x in enumerate(xs))
    assert [len(one) for one in visits([frame(k, ()) for k in range(len(xs))], truth)] == [2, 2, 1]


def test_what_differs_is_seen_from_near_by_and_in_the_picture() -> None:
    from twins import shows

    book = twins_of(104)
    ahead = moved(book.spots[0][0], book.spots[0][1], book.spots[0][2] - 1.0)  # it looks up at it
    assert shows(scene_view(), ahead, book, 0) and not shows(scene_view(), ahead, book, 1)
    assert not shows(scene_view(), moved(MIDDLE_X, 0.0, book.spots[0][2] - 5.0), book, 0)


def test_only_sessions_that_saw_what_differs_must_know_their_place() -> None:
    from twins import summary

    session = {"seen": 2, "constraints": 5, "false": 1, "alike": 3, "known": True}
    row = {
        "forced": {"tried": 9, "accepted": 8, "false": 1, "alike": 7},
        "sessions": [session, session | {"seen": 0, "known": False}],
        "not_stored": [session],
    }
    found = summary([row, row])
    assert (found["saw"], found["known"], found["sessions"]) == (2, 2, 4)
    assert found["false"] == 4 and found["forced"]["tried"] == 18 and found["not_stored_constraints"] == 10


def test_tries_are_taken_evenly() -> None:
    from twins import spaced

    assert spaced(range(10), 4) == [0, 3, 6, 9] and spaced(range(3), 9) == [0, 1, 2] and spaced([], 4) == []
    assert np.array(spaced(range(10), 1)).tolist() == [0]
