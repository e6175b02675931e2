# SPDX-License-Identifier: Apache-2.0
"""What closures say of two sessions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import moved

from objreg_tools.report.store.session_ties import MOST, SessionTie, joined
from objreg_tools.report.store.store_summary import describe, survey
from report.places import at, closure_of_move, store_of, tying


def tie(earlier: int, later: int, x: float) -> SessionTie:
    return SessionTie(
        earlier=earlier,
        later=later,
        T_earlier_later=moved(x),
        earlier_camera=np.zeros(3),
        later_camera=np.zeros(3),
    )


def test_a_closure_of_two_sessions_ties_the_frame_of_the_later_to_that_of_the_earlier(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0))]
    found = survey(store_of(tmp_path / "s.db", shown, [tying(1.0, 2.0, 0, 1, 0.5)]))
    (one,) = found.ties
    assert (one.earlier, one.later) == (0, 1)
    assert one.T_earlier_later == pytest.approx(moved(0.5)) and one.later_camera == pytest.approx(np.zeros(3))
    assert "tied together by constraints: sessions 0, 1" in describe(found)


def test_a_closure_that_names_the_later_session_first_ties_the_same_way(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0))]
    (one,) = survey(store_of(tmp_path / "s.db", shown, [tying(2.0, 1.0, 1, 0, -0.5)])).ties
    assert (one.earlier, one.later) == (0, 1) and one.T_earlier_later == pytest.approx(moved(0.5))


def test_closures_within_a_session_without_one_or_of_keyframes_that_are_gone_tie_nothing(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0))]
    closures = [
        closure_of_move(1.0, 2.0),
        tying(1.0, 9.0, 0, 1, 0.0),
        replace(tying(1.0, 2.0, 0, 1, 0.0), to_session=None),
    ]
    assert survey(store_of(tmp_path / "s.db", shown, closures)).ties == ()


def test_of_many_closures_between_two_sessions_some_are_read(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0))]
    closures = [tying(1.0, 2.0, 0, 1, 0.001 * k) for k in range(2 * MOST)]
    assert len(survey(store_of(tmp_path / "s.db", shown, closures)).ties) == MOST


def test_sessions_are_joined_along_ties_and_those_without_one_are_left_out() -> None:
    first, second = joined([tie(0, 1, 1.0), tie(1, 4, 0.5), tie(5, 6, 2.0)])
    assert list(first) == [0, 1, 4] and list(second) == [5, 6]
    assert first[4] == pytest.approx(moved(1.5)) and second[5] == pytest.approx(np.eye(4))
    assert joined([]) == []


def test_a_session_is_joined_by_the_tie_that_agrees_with_the_others_and_by_the_most() -> None:
    (group,) = joined([tie(0, 1, 9.0), tie(0, 1, 1.0), tie(0, 1, 1.01), tie(0, 2, 7.0), tie(1, 2, 1.0), tie(1, 2, 1.0)])
    assert group[1][0, 3] == pytest.approx(1.0, abs=0.02) and group[2][0, 3] == pytest.approx(2.0, abs=0.02)
