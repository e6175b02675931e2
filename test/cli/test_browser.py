# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from pathlib import Path

import pytest

from objreg_tools.cli import browser


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses that were opened, at a terminal."""
    addresses: list[str] = []
    monkeypatch.setattr(browser.webbrowser, "open", lambda address: addresses.append(address) is None)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    return addresses


def test_a_page_opens_where_somebody_sits_before_a_display(opened: list[str]) -> None:
    assert browser.open_page(Path("/x/a b.html"), {"DISPLAY": ":0"})
    assert opened == ["file:///x/a%20b.html"]


def test_nothing_opens_without_a_display_or_a_terminal(opened: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert not browser.open_page(Path("page.html"), {"DISPLAY": ""})
    monkeypatch.setattr(sys.stdout, "isatty", lambda: False, raising=False)
    assert not browser.open_page(Path("page.html"), {"DISPLAY": ":0"})
    assert opened == []
