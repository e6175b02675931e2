# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_tools.cli.watching.thinned import STEP_M, Thinned


def test_a_camera_that_stands_adds_no_point() -> None:
    line = Thinned(10)
    for x in (0.0, 0.4 * STEP_M, -0.4 * STEP_M, 1.5 * STEP_M):
        line.add((x, 0.0, 0.0))
    assert list(line) == [(0.0, 0.0, 0.0), (1.5 * STEP_M, 0.0, 0.0)]


def test_a_line_of_any_length_keeps_its_beginning_and_comes_near_its_end_in_bounded_memory() -> None:
    line = Thinned(50)
    for k in range(20_000):
        line.add((k * STEP_M, 0.0))
        assert len(line) <= 50
    points = list(line)
    assert points[0] == (0.0, 0.0) and points[-1][0] > 0.9 * 20_000 * STEP_M


def test_a_line_that_is_cleared_begins_anew() -> None:
    line = Thinned(5)
    line.add((1.0, 2.0))
    line.clear()
    assert list(line) == []
