# SPDX-License-Identifier: Apache-2.0
"""Tests of how the keyframes of the next day are counted and judged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from registration.samples import box, frame, moved

from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.truth import Truth

Row = dict[str, Any]


def row(known: int, answer: list[float] | None, closures: list[list[float]] | None = None) -> Row:
    closures = closures or []
    return {"known": known, "answer": answer, "closed": len(closures), "closures": closures, "reasons": {"odds": 1}}


def test_keyframes_of_two_known_objects_count_and_wrong_answers_always_do() -> None:
    from days import summary

    rows = [
        row(2, [1.0, 2.0], [[1.0, 2.0]]),
        row(3, [1.0, 9.0]),
        row(2, None),
        row(1, [1.0, 60.0]),
        row(0, None, [[9.0, 2.0]]),
    ]
    figures = summary(rows)
    assert (figures["keyframes"], figures["could"], figures["closed"], figures["answered"]) == (5, 3, 1, 2)
    assert (figures["near"], figures["strict"], figures["near_share"], figures["strict_share"]) == (2, 1, 0.667, 0.333)
    assert (figures["wrong"], figures["answers"], figures["wrong_closures"], figures["closures"]) == (1, 3, 1, 2)
    assert figures["missed_by_reason"] == {"odds": 1}


def test_the_table_shows_shares_beside_their_counts() -> None:
    from days import HEAD, line, summary

    text = line("REC", summary([row(2, [1.0, 2.0]), row(2, [4.0, 2.0])]))
    assert "2 = 1.000" in text and "1 = 0.500" in text and "0 of 2" in text and len(text) == len(HEAD)


def test_a_session_of_one_place_is_judged_keyframe_by_keyframe() -> None:
    from days import measure

    boxes = (box("cup", (0.0, 0.0, 1.0)), box("book", (0.3, 0.0, 1.2)))
    frames = [replace(frame(0.1 * k, boxes), T_odom_camera=moved(0.0)) for k in range(40)]
    rows = measure(frames, Truth((one.stamp_ns, moved(0.0)) for one in frames), RegistrarParams(threads=1))
    assert rows and all(one["known"] == 2 for one in rows)
    assert np.all(np.diff([one["keyframe_ns"] for one in rows]) > 0)
