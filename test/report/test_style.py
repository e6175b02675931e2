# SPDX-License-Identifier: Apache-2.0
"""One style sheet: every mark of the page has its colour, in light and in dark, and what is read can be read."""

from __future__ import annotations

import re

import pytest

from objreg_tools.report.page import TEMPLATES, page
from objreg_tools.report.run.figures import SERIES
from objreg_tools.report.run.run_summary import RunSummary

from .runs import TRUTH, summary

CSS = (TEMPLATES / "style.css").read_text()
MARKS = {"line", "dot", "swatch"}
TAGS = {("tag", kind) for kind in ("accepted", "false", "refused")}  # of pairs of pictures
LIGHT, DARK = (dict(re.findall(r"--(\w+):\s*(#\w+)", block)) for block in re.findall(r":root \{(.*?)\}", CSS, re.S))


def luminance(colour: str) -> float:
    """The relative luminance of a #rrggbb (WCAG 2)."""
    shares = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    """The contrast of two colours (WCAG 2), 1 to 21."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_every_mark_of_a_page_has_a_rule_of_its_own() -> None:
    text = page([(RunSummary.of("walk", summary(false=True), TRUTH), None)])
    drawn = {tuple(name.split()) for name in re.findall(r'class="([^"]+)"', text)}
    marks = {(base, style) for base, *styles in drawn if base in MARKS for style in styles}
    assert {base for base, _ in marks} == MARKS
    rules = {mark for mark in marks | TAGS if f".{mark[0]}.{mark[1]} {{" in CSS or mark[1].startswith("series-")}
    bare = (marks | TAGS) - rules
    assert not bare, "a mark without a rule is drawn black, or not at all"


def test_every_label_of_the_map_finds_its_colour() -> None:
    assert all(f".series-{k} {{ fill: var(--s{k}); }}" in CSS for k in range(SERIES))


def test_every_colour_that_is_used_is_there_in_light_and_in_dark() -> None:
    assert LIGHT.keys() == DARK.keys() == set(re.findall(r"var\(--(\w+)\)", CSS))


@pytest.mark.parametrize("colours", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["page", "card"])
def test_what_is_read_stands_out_from_what_it_is_written_on(colours: dict[str, str], ground: str) -> None:
    assert contrast(colours["ink"], colours[ground]) > 7.0
    for name in ("soft", "accepted", "false", "refused", "corrected"):  # of words, verdicts and links
        assert contrast(colours[name], colours[ground]) > 4.5, name


@pytest.mark.parametrize("colours", [LIGHT, DARK], ids=["light", "dark"])
def test_lines_and_verdicts_stand_out_from_a_card(colours: dict[str, str]) -> None:
    for name in ("true", "odometry", "corrected", "accepted", "false", "refused"):
        assert contrast(colours[name], colours["card"]) > 3.0, name


def test_no_words_have_the_colour_of_faint_lines() -> None:
    sheets = CSS + "".join(file.read_text() for file in TEMPLATES.glob("*.j2"))
    faint = re.findall(r"([^{}\n]*?) *\{[^{}]*(?<!-)(?:color|fill): var\(--faint\)", sheets)
    assert faint == [".dot.faint"]


def test_every_rule_is_closed_and_none_ends_the_style_of_the_page() -> None:
    depth = 0
    for sign in re.findall(r"[{}]", CSS):
        depth += 1 if sign == "{" else -1
        assert 0 <= depth <= 2
    assert depth == 0 and "<" not in CSS
