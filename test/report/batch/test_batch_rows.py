# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from objreg_tools.report.batch.batch_rows import Row

TRUTH = {"strict": 1, "loose": 2, "false": 3, "count": 6}
SUMMARY = {
    "frames": 5,
    "detections": 4,
    "objects": 3,
    "constraints": [{}] * 6,
    "rejected": {"slack": 2},
    "findings": [],
    "truth": TRUTH,
    "stage_ms": {"detect": {"p50": 1.5, "p95": 2.0}},
    "batch": {"seconds": 7.0, "revisits": 2},
}


def test_a_row_counts_what_a_run_found() -> None:
    row = Row.of(Path("/runs/a"), "a.json", SUMMARY)
    assert (row.name, row.frames, row.constraints, row.false, row.seconds) == ("a", 5, 6, 3, 7.0)
    assert row.revisits == 2 and Row.of(Path("/a"), "", {**SUMMARY, "batch": {"seconds": 1.0}}).revisits is None
    assert row.stage_p50_ms == {"detect": 1.5} and row.rejected == {"slack": 2}


def test_without_truth_no_constraint_is_true_or_false() -> None:
    row = Row.of(Path("/runs/a"), "a.json", {**SUMMARY, "truth": dict.fromkeys(TRUTH, 0)})
    assert (row.strict, row.loose, row.false) == (None, None, None)


def test_a_failure_is_one_line_and_a_bug_has_its_kind() -> None:
    assert Row.failed(Path("a"), OSError("not\nthere")).error == "not there"
    assert Row.failed(Path("a"), KeyError("x")).error == "KeyError: 'x'"
