# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from merge.stores import ASIDE, AWAY, BESIDE, HERE, PARAMS, two_stores
from objreg_tools.merge.figures import Evaluation, contradiction_row, described, evaluate, figures
from objreg_tools.merge.merging import merge
from objreg_tools.merge.one_map import Contradiction
from objreg_tools.truth import Truth, Truths

SECOND = 1_000_000_000
TRUTHS = Truths(
    {
        "east": Truth([(0, HERE), (SECOND, AWAY)]),
        "west": Truth([(30 * SECOND, BESIDE), (32 * SECOND, ASIDE)]),
    }
)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    folder = tmp_path_factory.mktemp("merged")
    return evaluate(merge(two_stores(folder), folder / "both.db", PARAMS))


def test_figures_have_the_maps_before_and_after_with_their_errors(found: Evaluation) -> None:
    of = figures(found, TRUTHS)
    assert json.loads(json.dumps(of)) == of
    assert [[row["sessions"] for row in rows] for rows in of["before"]] == [[[0]], [[1]]]
    (after,) = of["after"]
    assert after["sessions"] == [0, 1] and after["keyframes"] == after["error_of_keyframes"] == 4
    assert after["error_cm"] < 2.0 and of["ties_error"] == {"of": len(found.ties), "false": 0}
    assert of["counts"]["keyframes"] == 4 and of["search"]["searched"] == 2


def test_without_truth_nothing_is_said_to_be_true(found: Evaluation) -> None:
    of = figures(found)
    assert of["ties_error"] is None and of["after"][0]["error_cm"] is None
    assert "truth" not in described(found)


def test_ties_are_counted_by_sessions(found: Evaluation) -> None:
    (row,) = figures(found)["ties"]
    assert row["stores"] == [0, 1] and row["robots"] == ["east", "west"] and row["closures"] == len(found.ties)


def test_a_false_tie_is_counted(found: Evaluation) -> None:
    wrong = Truths(TRUTHS.of_robots | {"west": Truth([(30 * SECOND, AWAY), (32 * SECOND, AWAY)])})
    assert figures(found, wrong)["ties_error"]["false"] > 0


def test_contradictions_are_listed_with_the_first_in_words(found: Evaluation) -> None:
    doubted = Contradiction(found.ties[0], "not believed: 9.0 deviations from what all others say", 12.0, 34.0)
    row = contradiction_row(found, doubted)
    assert row["between_stores"] and row["translation_cm"] == 34.0 and row["stamps_ns"] == [0, 30 * SECOND]
    many = [replace(found.after[0], contradictions=(doubted,) * 12)]
    text = described(replace(found, after=many))
    assert "contradictions: 12" in text and "12.0° and 34.0 cm" in text and "and 2 more" in text


def test_a_store_without_a_tie_has_a_map_of_its_own(tmp_path: Path, found: Evaluation) -> None:
    apart = replace(found, after=[one for maps in found.before for one in maps], closures=[])
    assert "between stores: 0 closures" in described(apart) and "session 0 by " in described(apart)
