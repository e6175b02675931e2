# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

from objreg_tools.report.batch.batch_comparison import Change
from objreg_tools.report.batch.batch_page import batch_page, totals
from objreg_tools.report.batch.batch_rows import Row

GOOD = Row(
    "a",
    "/a",
    "a.json",
    frames=9,
    constraints=4,
    revisits=2,
    false=1,
    rejected={"slack": 3},
    stage_p50_ms={"detect": 2.0},
)
BLIND = Row("b", "/b", "b.json", frames=1, constraints=2, rejected={"slack": 4}, stage_p50_ms={"detect": 4.0})
GONE = Row("<c>", "/c", error="no such <file>")


def test_sums_are_over_all_and_false_ones_where_truth_is_known() -> None:
    summed = totals([GOOD, BLIND, GONE])
    assert (summed["recordings"], summed["failed"], summed["frames"], summed["constraints"], summed["false"]) == (
        3,
        1,
        10,
        6,
        1,
    )
    assert "false" not in totals([BLIND]) and "revisits" not in totals([BLIND])
    assert summed["revisits"] == 2


def test_revisits_have_a_column_of_their_own_beside_constraints() -> None:
    page = batch_page([GOOD, BLIND], {})
    assert '<td class="number">2</td><td class="number">4</td>' in page, "two revisits, closed by four constraints"
    assert '<td class="number">–</td><td class="number">2</td>' in page, "not known of how many revisits"


def test_a_page_has_every_recording_every_reason_and_every_failure() -> None:
    page = batch_page([GOOD, BLIND, GONE], {"version": "1.2.3"})
    assert 'href="a.json"' in page and "no such &lt;file&gt;" in page and "version 1.2.3" in page
    assert '<td>slack</td><td class="number">7</td>' in page
    assert '<td>detect</td><td class="number">3.0</td><td class="number">4.0</td>' in page


def test_a_finding_is_there_once_with_all_that_have_it_and_links_lead_to_pages() -> None:
    dark = {"what": "dark: 3 lux", "cause": "it was night", "todo": "put on a lamp", "anchor": "dark"}
    rows = [replace(GOOD, findings=[dark], page="a.html"), replace(BLIND, findings=[{**dark, "what": "dark: 4 lux"}])]
    page = batch_page(rows, {})
    assert page.count('<p class="what">') == 1 and "In 2 of 2: " in page and "with other numbers" in page
    assert page.count('href="a.html"') == 2 and page.count('href="b.json"') == 3


def test_changes_are_before_all_else_and_changed_rows_first() -> None:
    same, more = Change(BLIND, BLIND, kept=2), Change(GOOD, replace(GOOD, constraints=1), 1, 3, 0, {"x": (1, 2)})
    page = batch_page([BLIND, GOOD], {}, "/before", [same, more, Change(GONE, None)])
    part = page[page.index("Against /before") : page.index("<h2>Recordings")]
    assert "1 of 3 recordings changed" in part and "<strong>1 → 4</strong>" in part and "1 → 2" in part
    assert part.index(">a</a>") < part.index("&lt;c&gt;") < part.index(">b</a>") and "failed now" in part
