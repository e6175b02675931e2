# SPDX-License-Identifier: Apache-2.0
"""A reader gets nothing but the report: opens it, filters the pairs, opens one, goes on to the next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

SHOWN = "[...document.querySelector('article.run').querySelectorAll('tbody tr:not([hidden])[data-pair]')]"


def walk(browser: Any, page: Path) -> None:
    """Read the verdict, look at the refused pairs of one reason, open the first and the one after it."""
    browser.get(page.resolve().as_uri())
    text = browser.find_element("tag name", "body").text
    assert "none of the " in text, text[:1500]
    everything = browser.execute_script(f"return {SHOWN}.length")

    reason = browser.execute_script("const one = document.querySelector('.filter'); return one.options[1].value")
    _choose(browser, reason)
    some = browser.execute_script(f"return {SHOWN}.length")
    assert reason and 0 < some < everything
    _choose(browser, "")
    assert browser.execute_script(f"return {SHOWN}.length") == everything

    browser.execute_script(f"{SHOWN}[0].click()")
    opened = _place(browser)
    browser.execute_script("document.querySelector('dialog[open] .next').click()")
    assert _place(browser) != opened
    browser.execute_script("document.querySelector('dialog[open] .close').click()")
    assert not browser.find_elements("css selector", "dialog[open]")
    assert not [row for row in browser.get_log("browser") if row["level"] == "SEVERE"]


def _choose(browser: Any, reason: str) -> None:
    browser.execute_script(
        "const one = document.querySelector('.filter'); one.value = arguments[0];"
        "one.dispatchEvent(new Event('change'))",
        reason,
    )


def _place(browser: Any) -> str:
    """Which of the pairs the open pane says it shows, with both of its pictures drawn."""
    pane = browser.find_element("css selector", "dialog[open]")
    drawn = browser.execute_script(
        "return Promise.all([...arguments[0].querySelectorAll('.ends img')].map((i) => i.decode()))"
        ".then(() => [...arguments[0].querySelectorAll('.ends img')].filter((i) => i.naturalWidth).length)",
        pane,
    )
    assert drawn == 2
    return str(pane.find_element("css selector", ".place").text)
