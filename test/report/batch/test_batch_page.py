# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_tools.report.batch.batch_page import batch_page, totals
from objreg_tools.report.batch.batch_rows import Row

GOOD = Row("a", "/a", "a.json", frames=9, constraints=4, false=1, rejected={"slack": 3}, stage_p50_ms={"detect": 2.0})
BLIND = Row("b", "/b", "b.json", frames=1, constraints=2, rejected={"slack": 4}, stage_p50_ms={"detect": 4.0})
GONE = Row("<c>", "/c", error="no such <file>")


def test_sums_are_over_all_and_false_ones_where_truth_tells() -> None:
    told = totals([GOOD, BLIND, GONE])
    assert (told["recordings"], told["failed"], told["frames"], told["constraints"], told["false"]) == (3, 1, 10, 6, 1)
    assert "false" not in totals([BLIND])


def test_a_page_has_every_recording_every_reason_and_every_failure() -> None:
    page = batch_page([GOOD, BLIND, GONE], {"version": "1.2.3"})
    assert 'href="a.json"' in page and "no such &lt;file&gt;" in page and "version 1.2.3" in page
    assert '<td>slack</td><td class="number">7</td>' in page
    assert '<td>detect</td><td class="number">3.0</td><td class="number">4.0</td>' in page
