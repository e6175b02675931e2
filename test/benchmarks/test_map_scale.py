# SPDX-License-Identifier: Apache-2.0
"""Tests of how a long walk is solved and reported."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def test_a_walk_is_reported_part_by_part_and_its_beginning_at_once() -> None:
    import map_scale

    walk = map_scale.long_walk(900, 30, 1)
    figures = map_scale.ours(walk)
    last = figures["parts"][-1]
    assert last["closures"] == len(walk.closures) and last["keyframes"] <= figures["keyframes"] <= 900
    assert len(last["closure_ms"]) == 3 and last["false"] == walk.is_false.sum()
    short = map_scale.shortened(walk, 100.0)
    assert len(short.odometry) == 370
    assert all(closure.to_ns <= short.odometry[-1].stamp_ns for closure in short.closures)
    at_once = map_scale.at_once(walk, ["GTSAM LM"])
    assert at_once["methods"]["GTSAM LM"]["false_kept"] + at_once["methods"]["objreg"]["false_kept"] >= 1
    assert "GTSAM LM" in map_scale.rows_at_once(at_once)
