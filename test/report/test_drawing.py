# SPDX-License-Identifier: Apache-2.0
"""Where things land on a plot."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from objreg_tools.report.drawing import Plot, ticks


def test_ticks_are_round_and_within_the_bounds() -> None:
    assert ticks(0.0, 16.6) == [0, 5, 10, 15]
    assert ticks(-0.31, 0.44) == [-0.2, 0.0, 0.2, 0.4]


def test_equal_axes_show_a_square_as_a_square() -> None:
    plot = Plot.equal(np.array([[0.0, 0.0], [2.0, 2.0]]), width=400, most=300)
    across, up = plot.x(2.0) - plot.x(0.0), plot.y(0.0) - plot.y(2.0)
    assert across == pytest.approx(up) and up > 100


def test_what_is_drawn_is_well_formed_and_escaped() -> None:
    plot = Plot((0.0, 1.0), (0.0, 1.0))
    plot.x_axis("s")
    plot.y_axis("m")
    plot.line(np.array([[0.0, 0.0], [1.0, 1.0]]), "odometry", "a < b & c")
    plot.dot(0.5, 0.5, "accepted", "it's")
    plot.bar(0.2, 0.4, 0.5, "seen")
    plot.arc(0.1, 0.9, 0.5, 20.0, "accepted", "1 ↔ 2")
    plot.text(3, 4, "<label>")
    root = ElementTree.fromstring(plot.svg("a & b"))
    assert root.get("aria-label") == "a & b"
    assert root.find("polyline/title").text == "a < b & c"
    assert {child.tag for child in root} == {"line", "text", "polyline", "circle", "rect", "path"}


def test_a_long_line_is_thinned_and_keeps_its_ends() -> None:
    plot = Plot((0.0, 10_000.0), (0.0, 1.0))
    plot.line(np.column_stack([np.arange(10_001), np.zeros(10_001)]), "true")
    points = ElementTree.fromstring(plot.parts[0]).get("points").split()
    assert len(points) < 1000
    assert points[0].startswith(f"{plot.x(0):.1f},") and points[-1].startswith(f"{plot.x(10_000):.1f},")


def test_what_is_of_a_pair_can_be_pointed_at_above_all_that_is_drawn() -> None:
    plot = Plot((0.0, 1.0), (0.0, 1.0))
    plot.line(np.array([[0.0, 0.0], [1.0, 1.0]]), "link accepted", "a closure", pair="c3")
    plot.arc(0.1, 0.9, 0.5, 20.0, "accepted", "1 ↔ 2", pair="c3")
    plot.dot(0.5, 0.5, "refused", pair="r0")
    root = ElementTree.fromstring(plot.svg("drawing"))
    assert [child.get("data-pair") for child in root] == [None, None, "r0", "c3", "c3"]
    assert [child.get("class") for child in root][-2:] == ["hit", "hit"] and root[-2].find("title").text == "a closure"
    assert [child.get("data-of") for child in root][:2] == ["c3", "c3"]
