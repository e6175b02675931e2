# SPDX-License-Identifier: Apache-2.0
"""A batch as a page: what was found in each recording, why the rest was refused, and how long it took."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from objreg_tools.report.batch.batch_comparison import Change, ordered, settings_of
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.page import environment
from objreg_tools.report.run.reasons import REFUSALS

MOST_NAMED = 12  # recordings that are named at a finding


def batch_page(rows: Sequence[Row], about: Mapping[str, Any], against: str = "", changes: Sequence[Change] = ()) -> str:
    """The HTML of a batch; ``about`` lists by name what all its recordings were run with.

    ``changes`` are those since another batch, which is in the folder ``against``.
    """
    whole = [row for row in rows if not row.error]
    refused = sum((Counter(row.rejected) for row in whole), Counter[str]())
    return environment().get_template("batch.html.j2").render(
        about=about,
        tiles=totals(rows),
        rows=rows,
        failed=[row for row in rows if row.error],
        refused=[(reason, count, _meaning(reason)) for reason, count in refused.most_common()],
        stages=_stages(whole),
        findings=_findings(whole),
        most=MOST_NAMED,
        against=_against(against, changes) if changes else None,
    )  # fmt: skip


def totals(rows: Sequence[Row]) -> dict[str, int]:
    """What all recordings have together, by name; ``revisits`` only where they are known, ``false`` where truth is."""
    totals: dict[str, int] = {"recordings": len(rows), "failed": sum(bool(row.error) for row in rows)}
    totals |= {name: sum(getattr(row, name) for row in rows) for name in ("frames", "objects")}
    closed = [row.revisits for row in rows if row.revisits is not None]
    totals |= {"revisits": sum(closed)} if closed else {}
    totals["constraints"] = sum(row.constraints for row in rows)
    judged = [row.false for row in rows if row.false is not None]
    return {**totals, "false": sum(judged)} if judged else totals


def _findings(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Each kind of finding once, in the words of the first, with the rows that have it; the most frequent first."""
    kinds: dict[str, dict[str, Any]] = {}
    for row in rows:
        for finding in row.findings:
            kind = kinds.setdefault(finding["anchor"] or finding["what"], {**finding, "rows": [], "others": False})
            kind["others"] |= kind["what"] != finding["what"]
            if row not in kind["rows"]:
                kind["rows"].append(row)
    return sorted(kinds.values(), key=lambda kind: -len(kind["rows"]))


def _against(folder: str, changes: Sequence[Change]) -> dict[str, Any]:
    return {
        "folder": folder,
        "rows": ordered(changes),
        "changed": sum(change.is_changed for change in changes),
        "compared": any(change.before for change in changes),
        "settings": settings_of(changes),
    }


def _meaning(reason: str) -> str:
    return REFUSALS[reason].meaning if reason in REFUSALS else ""


def _stages(rows: Iterable[Row]) -> list[tuple[str, float, float]]:
    """Each stage with the median over recordings of their median times, ms, and the longest of these."""
    of_stage: dict[str, list[float]] = {}
    for row in rows:
        for stage, ms in row.stage_p50_ms.items():
            of_stage.setdefault(stage, []).append(ms)
    return [(stage, median(ms), max(ms)) for stage, ms in of_stage.items()]
