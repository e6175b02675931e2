# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

from objreg_tools.report.sweep.sweep_page import NO_TRUTH, set_words, sweep_page, verdict
from objreg_tools.report.sweep.sweep_rows import Setting

from .samples import BLIND, HIGH, LOW, ODDS, SAME, USUAL, found


def test_the_best_is_there_to_copy_and_first_in_the_table() -> None:
    page = sweep_page([LOW, USUAL, HIGH], {"version": "1.2.3"})
    assert f"--set {ODDS}=75" in page and "/**/registrar:" in page and "version 1.2.3" in page
    table = page[page.index("<h2>Combinations") :]
    assert table.index("best</span>") < table.index("<td>300") < table.index("<td>20")


def test_the_verdict_says_how_far_it_can_be_trusted() -> None:
    text = " ".join(verdict([LOW, USUAL, SAME]))
    assert "Best: least_odds 75: 7 of 10 revisits closed, 0 of 9 constraints false." in text
    assert "2 combinations are equally good" in text and "below 28.3 %" in text and "Only one recording" in text
    two = replace(USUAL, found=(*USUAL.found, *USUAL.found))
    assert "Only one recording" not in " ".join(verdict([two]))


def test_without_truth_no_best_is_named() -> None:
    page = sweep_page(BLIND, {})
    assert verdict(BLIND) == [NO_TRUTH] and "to copy" not in page and "Constraints against their odds" in page
    assert "Revisits against false constraints" not in page


def test_values_with_blanks_can_be_pasted_into_a_shell() -> None:
    one = Setting({"registrar.label_groups": ("a b",)}, ("registrar.label_groups=a b",))
    assert set_words(one) == "--set 'registrar.label_groups=a b'"


def test_what_failed_is_named_and_hostile_names_are_text() -> None:
    bad = replace(USUAL, found=(replace(found(), name="<i>", error="no such <file>"),))
    page = sweep_page([bad], {})
    assert "no such &lt;file&gt;" in page and "<i>" not in page and "<h2>Failed</h2>" in page
