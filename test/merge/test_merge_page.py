# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import pytest

from merge.stores import PARAMS, two_stores
from objreg_tools.merge.figures import Evaluation, evaluate
from objreg_tools.merge.merge_page import merge_page, part_of
from objreg_tools.merge.merging import merge
from objreg_tools.merge.one_map import Contradiction
from objreg_tools.report.store.store_page import WIDTHS, WIDTHS_TIED
from objreg_tools.report.store.store_summary import StoreSummary, survey


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Evaluation, StoreSummary]:
    folder = tmp_path_factory.mktemp("merged")
    merged = merge(two_stores(folder), folder / "both.db", PARAMS)
    return evaluate(merged), survey(merged.path)


def test_a_page_has_both_stores_before_and_one_frame_after(made: tuple[Evaluation, StoreSummary]) -> None:
    page = merge_page(*made)
    assert "Sessions 0, 1 in one frame" in page and "east.db" in page and "west.db" in page
    assert page.count("<svg viewBox") >= len(WIDTHS_TIED) + 2 * len(WIDTHS)
    assert page.count('class="line tie"') == len(made[0].ties) * len(WIDTHS_TIED)
    assert "http" not in page.replace("http://www.w3.org", "")


def test_a_page_lists_what_contradicts(made: tuple[Evaluation, StoreSummary]) -> None:
    found, summary = made
    doubted = Contradiction(found.ties[0], "not believed: 9.0 deviations", 12.0, 34.0)
    page = merge_page(replace(found, after=[replace(found.after[0], contradictions=(doubted,))]), summary)
    assert "not believed: 9.0 deviations" in page and "34.0" in page


def test_a_part_of_a_store_has_only_its_sessions(made: tuple[Evaluation, StoreSummary]) -> None:
    part = part_of(made[1], frozenset({1}))
    assert {one.session for one in part.sightings} == {1} and part.ties == ()
    assert [session["session"] for session in part.sessions] == [1]
