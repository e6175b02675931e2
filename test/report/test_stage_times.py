# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_tools.report.stage_times import in_order


def test_stages_stand_before_the_total_that_they_are_part_of() -> None:
    stages = {"keyframe": 9.0, "search": 8.0, "total": 3.0, "check": 1.0, "wait": 0.5, "track": 2.0}
    assert list(in_order(stages)) == [
        ("", "check", 1.0),
        ("", "track", 2.0),
        ("", "total", 3.0),
        (", keyframe", "wait", 0.5),
        (", keyframe", "search", 8.0),
        (", keyframe", "total", 9.0),
    ]


def test_a_search_is_part_of_the_total_where_keyframes_are_the_frames() -> None:
    stages = {"total": 9.0, "search": 8.0, "wait": 0.5}
    assert [stage for _, stage, _ in in_order(stages)] == [
        "search",
        "wait",
        "total",
    ]
