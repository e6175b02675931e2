# SPDX-License-Identifier: Apache-2.0
"""One page that needs nothing else."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest

from objreg_tools.report import page as pages
from objreg_tools.report.bundle import plotly_bundle
from objreg_tools.report.page import page
from objreg_tools.report.run import clouds, thumbnails
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth

from .runs import TRUTH, closure, summary, with_a_stray

VOID = {"meta", "img", "br", "input"}


class Balance(HTMLParser):
    """Counts what is opened and not closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_loads_nothing() -> None:
    text = page([(RunSummary.of("walk", summary(), TRUTH), None)])
    parser = Balance()
    parser.feed(text)
    assert parser.open == []
    assert not re.search(r"https?://|<script[^>]* src|<link|url\(", text)
    assert "prefers-color-scheme: dark" in text


def test_without_plotly_the_page_says_what_3d_needs_and_keeps_its_drawings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "plotly_bundle", lambda: "")
    text = page([(RunSummary.of("walk", summary(), TRUTH), None)])
    assert text.count("pip install plotly") == 1 and 'class="plot"' not in text and 'class="line corrected"' in text


def test_what_a_page_may_hold_leaves_2_mb_of_15_for_its_drawings() -> None:
    assert thumbnails.PAGE_BYTES + clouds.PAGE_BYTES + len(plotly_bundle()) <= 13_000_000


def test_a_run_with_nothing_in_space_does_not_carry_what_draws_it() -> None:
    assert len(page([(RunSummary.of("empty", {"frames": 3, "constraints": []}, Truth([])), None)])) < 100_000


def test_the_head_states_false_constraints_and_the_error() -> None:
    text = page([(RunSummary.of("walk", summary(false=True), TRUTH), None)])
    assert "1 of the 5 is false." in text and "better than odometry" in text
    assert "no truth to judge" in page([(RunSummary.of("walk", summary(), Truth([])), None)])


def test_the_head_counts_what_was_tried_apart_from_what_was_not() -> None:
    assert "2 candidates refused, 1 more not tried" in page([(RunSummary.of("walk", summary(), TRUTH), None)])
    run = {**summary(), "rejected": {"texture_disagrees": 2}}
    assert "2 candidates refused<" in page([(RunSummary.of("walk", run, TRUTH), None)])


def test_a_run_that_closed_nothing_says_so() -> None:
    run = {"frames": 3, "constraints": []}
    assert "No loop was closed" in page([(RunSummary.of("empty", run, Truth([])), None)])


def test_frames_that_are_left_out_are_counted() -> None:
    run = summary()
    assert "left out" not in page([(RunSummary.of("walk", run, TRUTH), None)])
    run["glimpses"] += run["glimpses"][-2:]
    assert " 2 frames are left out: their time is not later" in page([(RunSummary.of("walk", run, TRUTH), None)])


def test_closures_of_two_runs_of_the_clock_are_left_out_of_the_map_and_counted() -> None:
    run = summary()
    run["constraints"] += [closure(90, 30), closure(95, 35)]
    text = page([(RunSummary.of("walk", run, TRUTH), None)])
    assert "closed by 6 constraints" in text and " 2 closures are left out: they tie two runs of the clock" in text
    assert "two runs of the clock" not in page([(RunSummary.of("walk", summary(), TRUTH), None)])


def test_names_are_escaped() -> None:
    assert "<b>" not in page([(RunSummary.of("<b>", summary(), TRUTH), None)])


def test_what_is_of_another_time_is_counted_beside_the_timeline() -> None:
    assert "Left out:" not in page([(RunSummary.of("walk", summary(), TRUTH), None)])
    text = page([(RunSummary.of("walk", with_a_stray(-1_700_000_000 * 10**9), TRUTH), None)])
    assert "Left out: 1 frames, 1 refusals, more than an hour from the longest part of the run" in text


class Blank:
    """An album without pictures."""

    def lacking(self, stamp_ns: int) -> str:
        return "nothing is near"

    def at(self, stamp_ns: int) -> None:
        return None


def test_what_has_no_picture_is_counted_with_the_reason() -> None:
    text = page([(RunSummary.of("walk", summary(), TRUTH), Blank())])
    assert "Accepted registrations" in text and "No picture of 4 of these 4: nothing is near (4 times)." in text
    assert "No picture of 2 of these 2: nothing is near (2 times)." in text


def test_the_head_says_what_was_assumed_of_the_lens() -> None:
    run = {**summary(), "lens": "plumb_bob, moves a pixel by 4.8 px (median), 36.8 at most; rectified"}
    assert "Lens: plumb_bob, moves a pixel by 4.8 px" in page([(RunSummary.of("walk", run, TRUTH), None)])
    assert "Lens:" not in page([(RunSummary.of("walk", summary(), TRUTH), None)])


def test_runs_are_compared_before_them_or_after_them() -> None:
    two = [(RunSummary.of(name, summary(), TRUTH), None) for name in ("first", "second")]
    before, after = page(two), page(two, compared_last=True)
    assert before.index("<h1>Comparison</h1>") < before.index("<h1>first</h1>")
    assert after.index("<h1>first</h1>") < after.index("<h1>second</h1>") < after.index("<h1>Comparison</h1>")
