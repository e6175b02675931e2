# SPDX-License-Identifier: Apache-2.0
"""Tests of how answers about pairs of frames are counted."""

from __future__ import annotations

import numpy as np


def _pair(could_close: bool, turned: float = 5.0):  # type: ignore[no-untyped-def]
    from frame_pairs import Pair

    return Pair(0, 1, np.eye(4), turned, could_close)


def test_an_accepted_pose_is_wrong_where_it_is_far_off_or_could_not_be() -> None:
    from pair_figures import Row, is_wrong

    grey = Row((6.0, 12.0), True, 1.0)  # neither loose nor wrong
    assert not is_wrong(_pair(True), grey) and is_wrong(_pair(False), grey)
    assert is_wrong(_pair(True), Row((9.0, 1.0), True, 1.0)) and is_wrong(_pair(True), Row((1.0, 16.0), True, 1.0))
    assert not is_wrong(_pair(False), Row((2.0, 3.0), True, 1.0))
    assert not is_wrong(_pair(False), Row((90.0, 300.0), False, 1.0)) and not is_wrong(
        _pair(True), Row(None, False, 1.0)
    )


def test_recall_is_over_the_pairs_that_could_close_alone() -> None:
    from pair_figures import Row, summed

    right, refused, lie = (
        Row((1.0, 2.0), True, 10.0),
        Row((4.0, 8.0), False, 20.0, "slack"),
        Row((50.0, 90.0), True, 30.0),
    )
    figures = summed([_pair(True), _pair(True), _pair(False)], [right, refused, lie])
    assert (figures["tried"], figures["could_close"], figures["wrong"], figures["wrong_of_could_not"]) == (3, 2, 1, 1)
    assert (figures["strict"], figures["loose"], figures["accepted_recall"]) == (0.5, 1.0, 0.5)
    assert figures["refused"] == {"slack": 1} and figures["ms_p50"] == 20.0


def test_each_view_change_and_half_of_a_recording_is_counted_by_itself() -> None:
    from frame_pairs import Pair
    from pair_figures import Row, figures

    pairs = [Pair(0, 1, np.eye(4), 5.0, True), Pair(0, 9, np.eye(4), 25.0, True), Pair(8, 9, np.eye(4), 25.0, True)]
    rows = [Row((1.0, 2.0), True, 1.0), Row((1.0, 2.0), False, 1.0), Row((1.0, 2.0), True, 1.0)]
    found = figures(pairs, rows, middle=5)
    assert {name: part["could_close"] for name, part in found["by_view_change"].items()} == {"0-10": 1, "20-30": 2}
    assert {name: part["accepted_recall"] for name, part in found["half"].items()} == {
        "first": 1.0,
        "across": 0.0,
        "second": 1.0,
    }


def test_a_pose_that_is_right_at_some_lag_of_the_truth_is_not_wrong_at_every_lag() -> None:
    from pair_figures import Row, is_wrong_at_every_lag, line, summed

    late, lie = Row((9.0, 1.0), True, 1.0, lagged=((2.0, 1.0),)), Row((9.0, 1.0), True, 1.0, lagged=((8.5, 1.0),))
    assert not is_wrong_at_every_lag(_pair(True), late) and is_wrong_at_every_lag(_pair(True), lie)
    figures = summed([_pair(True), _pair(True)], [late, lie])
    assert (figures["wrong"], figures["wrong_at_every_lag"]) == (2, 1)
    assert "wrong   2 of 2, 1 at every lag" in line("ours", figures)
