# SPDX-License-Identifier: Apache-2.0
"""plotly.js in the page, where it is installed."""

from __future__ import annotations

import base64
import gzip
import sys
from collections.abc import Iterator

import pytest

from objreg_tools.report.bundle import plotly_bundle


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """The bundle is made anew, before and after."""
    plotly_bundle.cache_clear()
    yield
    plotly_bundle.cache_clear()


def test_the_bundle_is_all_of_plotly_in_2_mb() -> None:
    offline = pytest.importorskip("plotly.offline", reason="plotly is not installed")
    assert gzip.decompress(base64.b64decode(plotly_bundle())).decode() == offline.get_plotlyjs()
    assert len(plotly_bundle()) < 2_500_000


def test_without_plotly_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    assert plotly_bundle() == ""
