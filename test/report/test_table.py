# SPDX-License-Identifier: Apache-2.0
"""The tables of batches and sweeps in a real browser: sorted and searched, by the keyboard too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from objreg_tools.report.batch.batch_comparison import Change
from objreg_tools.report.batch.batch_page import batch_page
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.sweep.sweep_page import sweep_page

from .chromium import chromium
from .sweep.samples import HIGH, LOW, USUAL

TELEPHONE = {"width": 420, "height": 900, "deviceScaleFactor": 1, "mobile": False}
DARK = {"what": "dark: 3 lux", "cause": "it was night", "todo": "put on a lamp", "anchor": "dark"}
LONG = "a_recording_with_a_name_that_goes_on_and_on_without_a_single_blank_in_it"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    with chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of four recordings, of which one has no truth, against a batch of before."""
    rows = [
        Row("kitchen", "/r/kitchen", "k.json", frames=90, constraints=9, false=0),
        Row("office", "/r/office", "o.json", frames=100, constraints=20, false=2, findings=[DARK]),
        Row("hall", "/r/hall", "h.json", frames=8, constraints=3),
        Row(LONG, f"/r/{LONG}", "l.json", frames=70, constraints=100, false=1),
    ]
    changes = [Change(row, replace(row, constraints=1), 1, row.constraints - 1, 0) for row in rows]
    return written(tmp_path_factory, batch_page(rows, {"model": LONG}, "/before", changes))


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of three combinations."""
    return written(tmp_path_factory, sweep_page([LOW, USUAL, HIGH], {"model": LONG}))


def written(factory: pytest.TempPathFactory, text: str) -> Path:
    file = factory.mktemp("page") / "report.html"
    file.write_text(text, encoding="utf-8")
    return file


def shown(browser: Any, section: int = -1) -> list[str]:
    """The first cell of each row that a table shows, from above."""
    return list(
        browser.execute_script(
            "const section = [...document.querySelectorAll('section.table')].at(arguments[0]);"
            "const rows = [...section.querySelectorAll('tbody tr')];"
            "return rows.filter((row) => row.checkVisibility()).map((row) => row.cells[0].innerText.trim())",
            section,
        )
    )


def press(browser: Any, column: str, section: int = -1) -> str:
    """Press Enter on the head of a column; the order in which it sorts now."""
    head = browser.execute_script(
        "return [...[...document.querySelectorAll('section.table')].at(arguments[0]).querySelectorAll('th[data-sort]')]"
        ".find((head) => head.innerText.startsWith(arguments[1]))",
        section,
        column,
    )
    head.find_element("css selector", "button").send_keys("\n")
    return str(head.get_attribute("aria-sort"))


def search(browser: Any, text: str) -> str:
    """Type into the field of the last table; how many rows are shown, as it says."""
    section = browser.find_elements("css selector", "section.table")[-1]
    field = section.find_element("css selector", "input")
    field.clear()
    field.send_keys(text + " ")
    return str(section.find_element("css selector", ".count").text)


def test_numbers_are_sorted_as_numbers_and_what_has_none_is_last(browser: Any, batch: Path) -> None:
    browser.get(batch.as_uri())
    assert press(browser, "frames") == "descending" and shown(browser) == ["office", "kitchen", LONG, "hall"]
    assert press(browser, "frames") == "ascending" and shown(browser) == ["hall", LONG, "kitchen", "office"]
    assert press(browser, "false") == "descending" and shown(browser) == ["office", LONG, "kitchen", "hall"]
    assert press(browser, "false") == "ascending" and shown(browser) == ["kitchen", LONG, "office", "hall"]


def test_names_are_sorted_as_words(browser: Any, batch: Path) -> None:
    browser.get(batch.as_uri())
    assert press(browser, "recording") == "ascending" and shown(browser) == [LONG, "hall", "kitchen", "office"]


def test_a_search_finds_names_and_findings_and_can_be_taken_back(browser: Any, batch: Path) -> None:
    browser.get(batch.as_uri())
    assert search(browser, "LUX dark") == "1 of 4" and shown(browser) == ["office"]
    assert search(browser, "kitchen lux") == "0 of 4" and shown(browser) == []
    assert search(browser, "") == "4 of 4" and len(shown(browser)) == 4


def test_a_change_is_sorted_by_how_much_it_is(browser: Any, batch: Path) -> None:
    browser.get(batch.as_uri())
    assert shown(browser, 0)[0] == LONG
    press(browser, "constraints", 0), press(browser, "constraints", 0)
    assert shown(browser, 0) == ["hall", "kitchen", "office", LONG]


def test_combinations_are_sorted_by_recall_and_false(browser: Any, sweep: Path) -> None:
    browser.get(sweep.as_uri())
    assert [text.split()[0] for text in shown(browser)] == ["75", "300", "20"]
    press(browser, "closed")
    assert [text.split()[0] for text in shown(browser)] == ["20", "75", "300"]


@pytest.mark.parametrize("name", ["batch", "sweep"])
def test_nothing_is_wider_than_a_telephone_and_nothing_went_wrong(
    name: str, browser: Any, request: pytest.FixtureRequest
) -> None:
    browser.get(request.getfixturevalue(name).as_uri())
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", TELEPHONE)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= TELEPHONE["width"]
    assert browser.get_log("browser") == []
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
