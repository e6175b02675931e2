# SPDX-License-Identifier: Apache-2.0
"""Tests of how it is judged whether a later session knew where it was."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner


def test_only_starts_that_saw_a_known_object_for_long_enough_count_and_false_ones_always_do() -> None:
    from relocalisation import summary

    rows = [
        {"counts": True, "after_s": 1.0, "first": [1.0, 2.0], "drifted": 0, "answers": 3},
        {"counts": True, "after_s": 7.0, "first": [1.0, 2.0], "drifted": 1, "answers": 3},
        {"counts": True, "after_s": None, "first": None, "drifted": 0, "answers": 0},
        {"counts": False, "after_s": None, "first": [9.0, 2.0], "drifted": 2, "answers": 2},
    ]
    figures = summary(rows)
    assert (figures["sessions"], figures["could"], figures["in_time"], figures["share"]) == (4, 3, 1, 0.333)
    assert figures["false_sessions"] == 1 and figures["drifted"] == 3 and figures["median_s"] == 4.0


def test_without_recordings_it_says_what_it_needs(tmp_path: Path) -> None:
    from relocalisation import main

    result = CliRunner().invoke(main, ["--keep", str(tmp_path)])
    assert result.exit_code == 2 and "expected RECORDINGS or --simulate SCENARIO:SEED" in result.output
