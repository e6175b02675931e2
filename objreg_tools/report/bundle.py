# SPDX-License-Identifier: Apache-2.0
"""plotly.js, which draws in 3D, as a page carries it; plotly need not be installed."""

from __future__ import annotations

from functools import cache

from objreg_tools.report.packed import zipped


@cache
def plotly_bundle() -> str:
    """The gzip of plotly.js in base64, 2 MB; empty where plotly is not installed."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        return ""
    return zipped(get_plotlyjs().encode())
