# SPDX-License-Identifier: Apache-2.0
"""The table of evidence in docs/gate.md is that of the code."""

from __future__ import annotations

from pathlib import Path

from docs.evidence_table import PAGE, page_text, rows
from objreg_ros.registration.gate.kinds import KINDS


def test_the_page_is_that_of_the_code() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == page_text(page), "make it anew: python -m docs.evidence_table"


def test_every_kind_has_a_row_from_its_worst_reading_to_its_best() -> None:
    table = dict(zip(KINDS, list(rows())[2:], strict=True))
    assert all(row.startswith(f"| `{name}` | ") for name, row in table.items())
    assert "| 630 … 16000 |" in table["tested"] and "| 0.02 … 0.004 |" in table["rmse"]


def test_only_what_is_between_the_marks_is_made(tmp_path: Path) -> None:
    made = page_text("mine\n<!-- made by docs/evidence_table.py -->\nold\n<!-- end of what was made -->\nmine too\n")
    assert made.startswith("mine\n") and made.endswith("\nmine too\n") and "\nold\n" not in made
