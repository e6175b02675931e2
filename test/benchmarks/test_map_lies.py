# SPDX-License-Identifier: Apache-2.0
"""Tests of how mappers are compared on graphs with false closures."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def test_every_method_is_judged_on_the_same_closures() -> None:
    import map_lies

    row = next(row for seed in range(100, 120) if (row := map_lies.one(seed, ["GTSAM LM"])) is not None)
    assert set(row["methods"]) == {map_lies.OURS, map_lies.CLEAN_LM, "GTSAM LM"}
    assert row["methods"]["GTSAM LM"]["false_kept"] == row["false"] and row["clean_m"] > 0.0
    assert row["methods"][map_lies.CLEAN_LM]["false_kept"] == 0
    assert f"{row['closures'] - row['false']} right closures, {row['false']} false ones" in map_lies.table([row])


def test_a_walk_without_a_false_closure_counts_for_nothing() -> None:
    import map_lies

    walks = [map_lies.drawn(seed)[0] for seed in range(20)]
    uncounted = [seed for seed, one in enumerate(walks) if not one.is_false.any() or one.is_false.all()]
    assert uncounted and all(map_lies.one(seed, []) is None for seed in uncounted)


def test_the_share_of_what_is_too_much_counts_graphs_that_were_lost() -> None:
    import map_lies

    methods = [{"ours": {"ratio": ratio, "false_kept": 1, "right_pruned": 2}} for ratio in (1.0, 1.1, 1.5, np.inf)]
    figures = map_lies.summary([{"methods": one} for one in methods])["ours"]
    assert (figures["above_1.3"], figures["above_2"]) == (0.5, 0.25)
    assert (figures["false_kept"], figures["right_pruned"]) == (4, 8)
    assert figures["p99"] == np.inf
