# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: what one clicks on does what it says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from objreg_tools.report.bundle import plotly_bundle
from objreg_tools.report.page import page
from objreg_tools.report.run.run_summary import RunSummary
from report.run.test_thumbnails import Wall

from .chromium import chromium, violations
from .runs import TRUTH, summary

WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # 3D without a graphics card
ADVICE = "willReadFrequently"  # of Chromium to plotly, how it could measure letters faster
TELEPHONE = {"width": 420, "height": 900, "deviceScaleFactor": 1, "mobile": False}


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Chromium without a window, with the page of two runs."""
    with chromium(*WEBGL) as opened:
        opened.get(_written(tmp_path_factory.mktemp("page")).as_uri())
        yield opened


def _written(folder: Path) -> Path:
    runs = [
        (RunSummary.of("walk", summary(false=True), TRUTH), Wall()),
        (RunSummary.of("again", summary(), TRUTH), None),
    ]
    (folder / "report.html").write_text(page(runs), encoding="utf-8")
    return folder / "report.html"


def keys(browser: Any) -> list[str]:
    """The pairs of the first run that its table shows, from above."""
    rows = "document.querySelector('article.run').querySelectorAll('tbody tr:not([hidden])[data-pair]')"
    return list(browser.execute_script(f"return [...{rows}].map((row) => row.dataset.pair)"))


def click(browser: Any, selector: str) -> None:
    """Click where a mouse would, on the first that is shown."""
    browser.execute_script(
        "const one = [...document.querySelectorAll(arguments[0])].find((item) => item.checkVisibility());"
        "one.scrollIntoView({block: 'center'}); one.dispatchEvent(new MouseEvent('click', {bubbles: true}))",
        selector,
    )


def pane(browser: Any) -> dict[str, Any]:
    """What the open pane shows."""
    return dict(
        browser.execute_script(
            "const pane = document.querySelector('dialog[open]'); if (!pane) return {};"
            "return {text: pane.innerText, space: pane.querySelector('.space').dataset.pair,"
            "drawn: [...pane.querySelectorAll('img')].filter((i) => i.checkVisibility() && i.naturalWidth).length}"
        )
    )


def test_the_table_is_filtered_by_reason(browser: Any) -> None:
    filtering = "const one = document.querySelector('.filter'); one.value = arguments[0];"
    choose = filtering + "one.dispatchEvent(new Event('change'))"
    shown = {}
    for reason in ("texture_disagrees", "false", ""):
        browser.execute_script(choose, reason)
        shown[reason] = keys(browser)
    assert shown["texture_disagrees"] == ["r1", "r2"] and shown["false"] == ["c4"] and len(shown[""]) == 8


def test_the_table_is_sorted_by_error_with_what_has_none_at_the_end(browser: Any) -> None:
    click(browser, "th[data-sort=centimetres] button")
    assert keys(browser)[0] == "c4" and {*keys(browser)[5:]} == {"r0", "r1", "r2"}
    click(browser, "th[data-sort=centimetres] button")
    assert keys(browser)[4] == "c4" and {*keys(browser)[5:]} == {"r0", "r1", "r2"}


def test_a_row_opens_a_pair_with_both_pictures_and_the_overlay(browser: Any) -> None:
    click(browser, "tr[data-pair=c4]")
    pictures = "[...document.querySelectorAll('dialog[open] img')].filter((image) => image.checkVisibility())"
    browser.execute_async_script(f"Promise.all({pictures}.map((image) => image.decode())).then(() => arguments[0]())")
    shown = pane(browser)
    assert shown["drawn"] == 3 and shown["space"] == "c4" and "the pose is off by 0.0° and 50.0 cm" in shown["text"]
    click(browser, "dialog[open] .next")
    assert pane(browser)["space"] != "c4"
    click(browser, "dialog[open] .close")
    assert pane(browser) == {}


def test_enter_on_a_row_opens_its_own_pair_and_escape_closes_it(browser: Any) -> None:
    for pair in ("c2", "c4"):
        row = browser.find_element("css selector", f"article.run tr[data-pair={pair}]")
        browser.execute_script("arguments[0].focus()", row)
        browser.switch_to.active_element.send_keys("\n")
        assert pane(browser)["space"] == pair
        browser.switch_to.active_element.send_keys("\ue00c")
        assert pane(browser) == {} and browser.switch_to.active_element == row


def test_the_lines_between_features_are_switched_with_the_keyboard_and_are_absent_without_a_pose(browser: Any) -> None:
    click(browser, "tr[data-pair=c4]")
    shown = "return getComputedStyle(document.querySelector('dialog[open] g.agree')).display !== 'none'"
    browser.execute_script("document.querySelector('dialog[open] [data-lines=agree]').focus()")
    seen = [browser.execute_script(shown)]
    for _ in range(2):
        browser.switch_to.active_element.send_keys(" ")
        seen.append(browser.execute_script(shown))
    assert seen == [True, False, True] and "matched features agree with the pose" in pane(browser)["text"]
    click(browser, "dialog[open] .close")
    click(browser, "tr[data-pair=r1]")
    assert "matched features" not in pane(browser)["text"]
    click(browser, "dialog[open] .close")


def test_a_closure_in_the_drawing_opens_its_pair(browser: Any) -> None:
    click(browser, "article.run svg .hit[data-pair=c2]")
    assert pane(browser)["space"] == "c2"
    click(browser, "dialog[open] .close")


def test_what_was_lost_between_two_runs_opens_in_its_own(browser: Any) -> None:
    click(browser, ".comparison button.open[data-pair=c4]")
    assert pane(browser)["space"] == "c4"
    click(browser, "dialog[open] .close")


def in_space(browser: Any, place: str) -> dict[str, Any]:
    """What is drawn in 3D at a place once it is there: the names of what the legend has, and points a trace."""
    until = f"const plot = () => document.querySelector('{place} .plot'), done = arguments[0];"
    answer = (
        "const traces = plot().data; done({names: traces.map((t) => t.name), counts: traces.map((t) => t.x.length)})"
    )
    look = (
        f"plot()?._fullLayout?.scene?._scene && !plot().hidden ? setTimeout(() => {{ {answer} }}) : setTimeout(see, 20)"
    )
    return dict(browser.execute_async_script(f"{until} (function see() {{ {look} }})()"))


@pytest.mark.skipif(not plotly_bundle(), reason="plotly is not installed")
def test_the_way_and_both_clouds_of_a_pair_can_be_turned_about_once_one_asks(browser: Any) -> None:
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", TELEPHONE)
    assert browser.execute_script("return window.Plotly === undefined"), "nothing is loaded before"
    click(browser, ".world .draw")
    drawn = in_space(browser, ".world")
    assert {"truth", "odometry", "corrected", "closure", "cup", "book"} <= {*drawn["names"]}
    click(browser, "tr[data-pair=c4]")
    click(browser, "dialog[open] .draw")
    assert in_space(browser, "dialog[open]")["counts"] == [48 * 64, 48 * 64]
    click(browser, "dialog[open] .close")


def test_nothing_is_wider_than_a_telephone_and_nothing_went_wrong(browser: Any) -> None:
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", TELEPHONE)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= TELEPHONE["width"]
    size = "const label = document.querySelector('.narrow svg text'), box = label.ownerSVGElement;"
    letter = browser.execute_script(f"{size} return 12 * box.clientWidth / box.viewBox.baseVal.width")
    assert letter >= 10, "letters of a drawing in px"
    assert [row for row in browser.get_log("browser") if ADVICE not in row["message"]] == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [TELEPHONE["width"], 1280])
def test_axe_finds_nothing_wrong_with_the_page(browser: Any, width: int, scheme: str) -> None:
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {**TELEPHONE, "width": width})
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    assert violations(browser) == []
