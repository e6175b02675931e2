# SPDX-License-Identifier: Apache-2.0
"""Writes the table of the kinds of evidence, with their ranges and weights, into docs/gate.md.

python -m docs.evidence_table
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from objreg_ros.registration.gate.kinds import KINDS, Kind
from objreg_ros.registration.gate.weights import UNKNOWN, WEIGHTS

PAGE = Path(__file__).parent / "gate.md"
BEGIN, END = "<!-- made by docs/evidence_table.py -->", "<!-- end of what was made -->"


def page_text(page: str) -> str:
    """The page with the table made anew."""
    before, _, rest = page.partition(BEGIN)
    table = "\n".join(rows())
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{rest.partition(END)[2]}"


def rows() -> Iterator[str]:
    """The table in Markdown: a kind a row, from its worst reading to its best."""
    yield "| evidence | what is read | worst … best | weight | where it is not known | reason |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, kind in KINDS.items():
        weights = sorted(WEIGHTS[name])
        span = f"{weights[0]:+.2f} … {weights[-1]:+.2f}"
        yield f"| `{name}` | {kind.phrase} | {_range(kind)} | {span} | {UNKNOWN[name]:+.2f} | `{kind.reason.value}` |"


def _range(kind: Kind) -> str:
    knots = kind.knots if kind.rises else kind.knots[::-1]
    worst, best = (_reading(kind, knot) for knot in (knots[0], knots[-1]))
    return f"{worst:g} … {best:g}"


def _reading(kind: Kind, knot: float) -> float:
    """The reading at a knot, which may be its decimal logarithm."""
    return knot if kind.scaled(1000.0) == 1000.0 else float(f"{10.0**knot:.2g}")


if __name__ == "__main__":
    PAGE.write_text(page_text(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
