# SPDX-License-Identifier: Apache-2.0
"""The figures of `streams` as text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from stream_faults import FAULT_ANCHORS, KINDS, RIGHT

Row = dict[str, Any]
HEAD = f"{'kind':20} {'cases':>5} {'constraints':>11} {'of right':>8} {'false':>5} {'losing':>6} {'named':>5}  others"
MOUNT_HEAD = f"{'mount unknown':20} {'cases':>5} {'constraints':>11} {'of known':>8} {'share':>6}  error of estimate"
SHARED_HEAD = f"{'recording':28} {'constraints':>11} {'false':>5}  findings"
ENOUGH = 300  # cases for the figures to say something


def by_kind(rows: Sequence[Row]) -> dict[str, Row]:
    """Figures added up by kind of fault, of rows as `stream_cases.judged` gives them."""
    return {kind: added([row for row in rows if row["kind"] == kind]) for kind in KINDS if _any(rows, kind)}


def added(rows: Sequence[Row]) -> Row:
    """Figures added up."""
    losing = [row for row in rows if row["loses"]]
    return {
        "cases": len(rows),
        **{name: sum(row[name] for row in rows) for name in ("constraints", "right", "false")},
        "losing": len(losing),
        "named": sum(row["named"] for row in losing),
        "other_causes": sorted({anchor for row in rows for anchor in wrong_causes(row)}),
    }


def wrong_causes(row: Row) -> set[str]:
    """The causes that were found in a recording which has another fault, or none."""
    return set(row["findings"]) & FAULT_ANCHORS - KINDS[row["kind"]].anchors


def totals(rows: Sequence[Row]) -> Row:
    """What the whole is judged by: false constraints, the share of losses whose cause is named, and causes that were
    found in right recordings."""
    faults = [row for row in rows if row["kind"] != RIGHT]
    right = [row for row in rows if row["kind"] == RIGHT]
    of_faults = added(faults)
    return {
        **{name: of_faults[name] for name in ("cases", "false", "losing", "named")},
        "named_share": round(of_faults["named"] / max(1, of_faults["losing"]), 3),
        "right_cases": len(right),
        "right_with_cause": sum(bool(wrong_causes(row)) for row in right),
        "seconds_per_case": round(float(np.mean([row["seconds"] for row in rows])), 2),
    }


def table(rows: Sequence[Row]) -> str:
    """A line a kind of fault, and the totals with what they should be."""
    lines = [HEAD, *(_line(kind, row) for kind, row in by_kind(rows).items())]
    total = totals(rows)
    return "\n".join(
        [
            *lines,
            f"{total['false']} false constraints in {total['cases']} cases (goal: 0 in {ENOUGH} or more)",
            f"cause named in {total['named']} of {total['losing']} that lose closures (goal: 0.9 of them)",
            f"a cause found in {total['right_with_cause']} of {total['right_cases']} right recordings (goal: 0)",
            f"{total['seconds_per_case']} s a case",
        ]
    )


def _line(kind: str, row: Row) -> str:
    counts = f"{row['cases']:>5} {row['constraints']:>11} {row['right']:>8} {row['false']:>5} {row['losing']:>6}"
    return f"{kind:20} {counts} {row['named']:>5}  {', '.join(row['other_causes'])}"


def mount_table(rows: Sequence[Row]) -> str:
    """By ground what is left of the constraints where the mount is unknown, and how far the estimated one is off."""
    grounds = dict.fromkeys(row["ground"] for row in rows)
    return "\n".join([MOUNT_HEAD, *(_mount_line(name, [r for r in rows if r["ground"] == name]) for name in grounds)])


def _mount_line(name: str, rows: Sequence[Row]) -> str:
    found, known = sum(row["constraints"] for row in rows), sum(row["right"] for row in rows)
    degrees = [row["mount_error"][0] for row in rows if row["mount_error"] is not None]
    error = f"{np.median(degrees):.1f}° median, {max(degrees):.1f}° worst of {len(degrees)}" if degrees else "none made"
    return f"{name:20} {len(rows):>5} {found:>11} {known:>8} {found / max(1, known):>6.2f}  {error}"


def shared_table(rows: Iterable[Row]) -> str:
    """A line for each recording of the generators."""
    return "\n".join([SHARED_HEAD, *map(_shared_line, rows)])


def _shared_line(row: Row) -> str:
    said = ", ".join(row["findings"]) or row.get("refused", "")
    return f"{row['case']:28} {row['constraints']:>11} {row['false']:>5}  {said}"


def _any(rows: Sequence[Row], kind: str) -> bool:
    return any(row["kind"] == kind for row in rows)
