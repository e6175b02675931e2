# SPDX-License-Identifier: Apache-2.0
"""A store as a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from registration.samples import box

from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_tools.report.store.portraits import TILE
from objreg_tools.report.store.store_page import WIDTHS_TIED, store_page
from objreg_tools.report.store.store_summary import survey
from report.chromium import chromium
from report.places import at, closure_of_move, cup_and_book, store_of, tying


class Rows(HTMLParser):
    """Counts tags."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)


def tags(page: str) -> list[str]:
    reader = Rows()
    reader.feed(page)
    return reader.tags


def test_a_page_has_all_sessions_all_objects_and_the_pictures_that_there_are(tmp_path: Path) -> None:
    found = survey(cup_and_book(tmp_path / "s.db"))
    page = store_page(found, {found.landmarks[0].landmark: np.zeros((TILE, TILE, 3), np.uint8)})
    assert "Session 0" in page and "Session 1" in page and "x [m]" in page
    assert tags(page).count("tr") == 1 + len(found.landmarks) and tags(page).count("img") == 1
    assert "http" not in page.replace("http://www.w3.org", "")


def tied(file: Path) -> Path:
    """Two sessions that a closure ties, half a metre apart, with a third beside them."""
    shown = [(1.0, 0, at(0.0)), (2.0, 1, at(0.0)), (3.0, 2, at(0.0))]
    return store_of(file, shown, [tying(1.0, 2.0, 0, 1, 0.5)])


def test_tied_sessions_are_drawn_in_one_frame_with_their_ties(tmp_path: Path) -> None:
    page = store_page(survey(tied(tmp_path / "s.db")), {})
    assert "Sessions 0, 1 in one frame" in page and "1 constraints between these sessions" in page
    assert page.count('class="line tie"') == len(WIDTHS_TIED)
    assert "in one frame</h2>" not in store_page(survey(cup_and_book(tmp_path / "apart.db")), {})


SIZES = [(1280, "light"), (1280, "dark"), (420, "light"), (420, "dark")]


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_in_a_browser_a_search_leaves_what_is_looked_for_and_nothing_is_cut_off(
    width: int, scheme: str, tmp_path: Path
) -> None:
    file = tmp_path / "page.html"
    file.write_text(store_page(survey(tied(tmp_path / "s.db")), {}), encoding="utf-8")
    with chromium() as browser:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        browser.get(file.as_uri())
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
        table = "const table = document.querySelector('.objects'); return table.scrollWidth - table.clientWidth"
        assert browser.execute_script(table) <= 0, "the table of objects fits"
        overlaps, named = browser.execute_script(OVERLAPS)
        assert overlaps == [] and named > 0
        browser.execute_script(SEARCH, "CUP")
        shown, dimmed = browser.execute_script(SHOWN)
        assert shown and all(name.startswith("cup") for name in shown)
        assert dimmed and all(name.startswith("book") for name in dimmed)
        assert not [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]


OVERLAPS = """
const names = [...document.querySelectorAll("svg text.name")].filter((one) => one.checkVisibility());
const boxes = names.map((one) => [one.closest("svg"), one.getBoundingClientRect(), one.textContent]);
const meets = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
const found = [];
boxes.forEach(([svg, box, text], k) => boxes.slice(k + 1).forEach(([other, its, name]) => {
  if (svg === other && meets(box, its)) found.push([text, name]); }));
return [found, names.length];
"""
SEARCH = """
const box = document.querySelector(".search input");
box.value = arguments[0]; box.dispatchEvent(new Event("input"));
"""
SHOWN = """
const rows = [...document.querySelectorAll("tr[data-name]")].filter((row) => row.checkVisibility());
return [rows.map((row) => row.dataset.name), [...document.querySelectorAll("text.dim")].map((one) => one.textContent)];
"""


def test_a_page_says_what_moved_or_that_no_constraint_shows_it(tmp_path: Path) -> None:
    shown = [(1.0, 0, at(0.0)), (2.0, 0, at(0.4))]
    still = store_page(survey(store_of(tmp_path / "a.db", shown)), {})
    moved = store_page(
        survey(store_of(tmp_path / "b.db", shown, [closure_of_move(1.0, 2.0), closure_of_move(1.0, 9.0)])), {}
    )
    assert "No constraint of this store shows that an object moved" in still
    assert "went 0.40 m between 0.0 s of session 0 and 1.0 s of session 0" in moved
    assert "1 constraints report another" in moved


def test_labels_are_escaped_and_an_empty_store_has_a_page(tmp_path: Path) -> None:
    file = store_of(tmp_path / "s.db", [(1.0, 0, (box("<b>", (0, 0, 1)),))])
    assert "<b>" not in store_page(survey(file), {})
    Store(tmp_path / "empty.db").close()
    assert "The store is empty" in store_page(survey(tmp_path / "empty.db"), {})


class Counted(tuple[Sighting, ...]):
    """Sightings that count how often all of them are gone through."""

    times = 0

    def __iter__(self) -> Iterator[Sighting]:
        self.times += 1
        return super().__iter__()


def test_how_often_the_sightings_are_gone_through_does_not_grow_with_the_objects(tmp_path: Path) -> None:
    times = []
    for count in (2, 12):
        objects = tuple(box(f"thing {k}", (k, 0, 1), instance=k + 1) for k in range(count))
        found = survey(store_of(tmp_path / f"{count}.db", [(1.0, 0, objects), (2.0, 1, objects)]))
        sightings = Counted(found.sightings)
        assert len(found.landmarks) >= count and store_page(replace(found, sightings=sightings), {})
        times.append(sightings.times)
    assert times[0] == times[1]
