# SPDX-License-Identifier: Apache-2.0
"""Tests of how a long walk is solved and told."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def test_a_walk_is_told_part_by_part_and_its_beginning_at_once() -> None:
    import map_scale

    words = map_scale.long_walk(900, 30, 1)
    told = map_scale.ours(words)
    last = told["parts"][-1]
    assert last["closures"] == len(words.closures) and last["keyframes"] <= told["keyframes"] <= 900
    assert len(last["closure_ms"]) == 3 and last["false"] == words.is_false.sum()
    short = map_scale.shortened(words, 100.0)
    assert len(short.odometry) == 370 and all(word.to_ns <= short.odometry[-1].stamp_ns for word in short.closures)
    at_once = map_scale.at_once(words, ["GTSAM LM"])
    assert at_once["methods"]["GTSAM LM"]["false_kept"] + at_once["methods"]["objreg"]["false_kept"] >= 1
    assert "GTSAM LM" in map_scale.rows_at_once(at_once)
