# SPDX-License-Identifier: Apache-2.0
"""The schemes are well-formed, small, and one for each reason of a refusal."""

from __future__ import annotations

from xml.etree import ElementTree

from docs.schemes import DROPS, HEIGHT, SCHEMES, WIDTH, arrow, picture, words
from objreg_tools.report.run.reasons import DROPS as DROP_TEXTS
from objreg_tools.report.run.reasons import REFUSALS


def test_every_refusal_has_a_scheme() -> None:
    assert set(SCHEMES) == set(REFUSALS)


def test_every_drop_is_in_one_of_the_two_schemes_of_a_way() -> None:
    drawn = " ".join(DROPS.values())
    assert not [name for name in DROP_TEXTS if name not in drawn]


def test_a_scheme_is_a_small_drawing_within_its_frame() -> None:
    for svg in [*SCHEMES.values(), *DROPS.values()]:
        drawing = ElementTree.fromstring(svg)
        assert drawing.get("width") == str(WIDTH) and len(svg) < 6_000, svg
        at = [
            (float(text.get("x", "")), float(text.get("y", ""))) for text in drawing.iter() if text.tag.endswith("text")
        ]
        assert all(0 <= x <= WIDTH and 0 < y < float(drawing.get("height", "0")) for x, y in at), svg


def test_words_are_escaped_and_an_arrow_ends_where_it_is_asked_to() -> None:
    drawing = ElementTree.fromstring(picture(words(1, 2, "a < b & c"), arrow(0, 0, 10, 0, "red")))
    assert "a < b & c" in "".join(drawing.itertext()) and drawing.get("height") == str(HEIGHT)
    assert any("10.0,0.0" in (part.get("points") or "") for part in drawing.iter())
