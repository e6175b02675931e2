# SPDX-License-Identifier: Apache-2.0
"""A browser for tests; a test skips where there is none."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

import pytest


@contextmanager
def chromium(*arguments: str) -> Iterator[Any]:
    """Chromium without a window, which keeps what its console says, with more arguments on its command line."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    program, driver = (shutil.which(name) for name in ("chromium", "chromedriver"))
    if program is None or driver is None:
        pytest.skip("chromium or chromedriver is not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", *arguments):
        options.add_argument(argument)
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield opened
    finally:
        opened.quit()


AXE = """const done = arguments[0];
axe.run({exclude: ['.js-plotly-plot']}, {resultTypes: ['violations']}).then((all) => done(all.violations))"""


def violations(browser: Any) -> list[str]:
    """What axe-core finds wrong with the page for those who see little or use no mouse, each with a place.

    What plotly makes is left out.
    """
    pytest.importorskip("axe_core_python", reason="axe-core-python is not installed")
    browser.set_script_timeout(60)
    browser.execute_script(files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8"))
    return [f"{one['id']}: {one['nodes'][0]['target']}" for one in browser.execute_async_script(AXE)]
