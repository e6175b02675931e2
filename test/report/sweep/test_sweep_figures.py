# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re

from objreg_tools.report.page import TEMPLATES
from objreg_tools.report.sweep.sweep_figures import (
    COLOURS,
    against_parameters,
    constraints_against_odds,
    recall_against_false,
    styles_of,
)

from .samples import BLIND, HIGH, LOW, ODDS, USUAL, setting


def dots(svg: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'<circle class="dot [^"]+" cx="([\d.]+)" cy="([\d.]+)"', svg)]


def test_more_false_is_to_the_right_and_more_recall_above() -> None:
    low, usual = dots(recall_against_false([LOW])), dots(recall_against_false([USUAL, LOW]))
    assert len(low) == 1 and len(usual) == 2
    (x_low, y_low), (x_usual, y_usual) = usual
    assert x_low > x_usual and y_low < y_usual
    assert "90 % of the revisits, 2 of 12 false" in recall_against_false([LOW])


def test_without_truth_there_is_no_recall_but_the_odds_are_drawn() -> None:
    assert recall_against_false(BLIND) == "" and constraints_against_odds(BLIND).count("<polyline") == 2
    assert constraints_against_odds([setting(20.0, odds=())]) == ""


def test_each_parameter_has_a_dot_for_each_combination() -> None:
    (one,) = against_parameters([LOW, USUAL, HIGH])
    assert one["name"] == ODDS and len(dots(one["svg"])) == 3 and ">300</text>" in one["svg"]


def test_a_sweep_that_found_nothing_is_drawn_too() -> None:
    (one,) = against_parameters([setting(20.0, constraints=0), setting(75.0, constraints=0)])
    assert "nan" not in one["svg"]


def test_those_beyond_the_colours_are_faint_and_every_style_has_its_rule() -> None:
    many = [setting(float(k)) for k in range(COLOURS + 2)]
    styles, css = set(styles_of(many).values()), (TEMPLATES / "style.css").read_text()
    assert styles == {*(f"series-{k}" for k in range(COLOURS)), "faint"}
    assert all(f".line.{style} {{" in css for style in styles) and ".dot.faint {" in css
