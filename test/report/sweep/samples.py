# SPDX-License-Identifier: Apache-2.0
"""Sweeps that never were."""

from __future__ import annotations

from typing import Any

from objreg_tools.report.sweep.sweep_rows import Found, Setting

ODDS = "registrar.least_odds"


def found(**counts: Any) -> Found:
    return Found("a", "/r/a", "runs/0/a.json", **{"frames": 9, "odds": (300.0, 90.0), **counts})


def setting(least_odds: float, changed: int = 1, **counts: Any) -> Setting:
    """One value of the odds in one recording."""
    return Setting({ODDS: least_odds}, (f"{ODDS}={least_odds:g}",), changed, (found(**counts),))


LOW = setting(20.0, constraints=12, judged=12, loose=9, false=2, revisits=10, closed=9)
USUAL = setting(75.0, changed=0, constraints=9, judged=9, loose=9, false=0, revisits=10, closed=7)
SAME = setting(80.0, constraints=9, judged=9, loose=9, false=0, revisits=10, closed=7)
HIGH = setting(300.0, constraints=4, judged=4, loose=4, false=0, revisits=10, closed=3)
BLIND = [setting(20.0, constraints=12), setting(75.0, changed=0, constraints=9)]
