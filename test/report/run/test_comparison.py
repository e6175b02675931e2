# SPDX-License-Identifier: Apache-2.0
"""Two runs side by side."""

from __future__ import annotations

from typing import Any

from objreg_tools.report.page import page
from objreg_tools.report.run.comparison import KEYFRAME_NS, comparison, matched, names_of
from objreg_tools.report.run.run_summary import RunSummary
from report.runs import TRUTH, closure, refusal, summary


def run_with(params: dict[str, Any], **others: Any) -> RunSummary:
    made = {"version": "0.1.0", "commit": "abc", "params": params, "date": "now", "model": {"name": "m", "sha256": "1"}}
    return RunSummary.of("walk", {**summary(), "about": made, **others}, TRUTH)


def test_runs_are_named_by_what_differs_between_them() -> None:
    names = names_of([run_with({}), run_with({"registrar.seed": 7, "detector.threshold": 0.4})])
    assert names == [
        "A: registrar.seed default, detector.threshold default",
        "B: registrar.seed 7, detector.threshold 0.4",
    ]
    assert names_of([run_with({}), run_with({})])[1] == "B: walk, made as the others"


def test_constraints_are_the_same_within_the_time_of_a_keyframe() -> None:
    all_runs = [RunSummary.of("walk", {**summary(), "constraints": rows}, TRUTH) for rows in (
        [closure(5, 65), closure(20, 80), closure(40, 100)],
        [closure(20 + KEYFRAME_NS // 10**8, 80), closure(40, 112), closure(6, 64)],
    )]  # fmt: skip
    assert matched(all_runs[0].closures, all_runs[1].closures) == {0: 2, 1: 0}


def test_a_constraint_is_matched_once_with_the_nearest() -> None:
    run = RunSummary.of("walk", {**summary(), "constraints": [closure(20, 80), closure(21, 81)]}, TRUTH)
    assert matched(run.closures, run.closures[1:]) == {1: 0}


def test_what_was_gained_and_lost_is_listed_with_what_became_of_it() -> None:
    before = run_with({})
    rows = [closure(k, k + 60) for k in (5, 20, 40)]
    after = run_with({}, constraints=[*rows, closure(10, 95)], refusals=[refusal("low_overlap", 54, 116)])
    (change,) = comparison([before, after])["changes"]
    assert change["title"] == "B against A" and change["kept"] == 3
    ((gained,), (lost,)) = change["gained"], change["lost"]
    assert (gained["times"], gained["run"], gained["key"]) == ("1.0 s ↔ 9.5 s", 1, "c3")
    assert gained["instead"] == "texture disagrees: 0.3 < 0.5 & texture_disagrees"
    assert lost["times"] == "5.5 s ↔ 11.5 s" and lost["instead"].startswith("low overlap: ")


def test_runs_of_different_recordings_are_not_matched() -> None:
    text = page([(run_with({}, recording="/a"), None), (run_with({}, recording="/b"), None)])
    assert "of different recordings" in text and "were gained" not in text


def test_the_table_states_errors_reasons_and_times_of_each() -> None:
    slow = {"detect": {"p50": 16.0, "p95": 20.0}}
    table = dict(comparison([run_with({}), run_with({}, stage_ms=slow, rejected={"gravity_not_kept": 3})])["table"])
    assert table["detect, median"] == ["8.0 ms", "16.0 ms"] and table["register, median"] == ["0.2 ms", "–"]
    assert table["gravity not kept"] == ["0", "3"] and table["false constraints"] == ["0 of 4", "0 of 4"]
    assert table["error before correction"][0].endswith(" cm")
