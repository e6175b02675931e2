# SPDX-License-Identifier: Apache-2.0
"""A researcher runs two recordings as a batch, compares two batches, sweeps a parameter and goes on with the best."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet

from .walk import ROOM, Walk

FRAMES = ("--max-frames", "24")
SWEPT = ("--set", "registrar.least_odds=20,75,3000")


def walk(folder: Path, first: Path) -> None:
    """Leaves before, after, sweep, and best.json in the folder."""
    researcher = Walk(folder)
    researcher.type("simulate", "second", *ROOM[:2], "--seed", "2", *ROOM[4:])
    recordings = (str(first), "second")
    done = researcher.type("batch", *recordings, "--out", "before", *FRAMES)
    assert "recordings: 2, failed: 0, frames: 48" in done.output
    assert len([*(folder / "before").glob("*-*.html")]) == 2 and (folder / "before/report.html").is_file()

    _compare(researcher, recordings)
    best = _sweep(researcher, recordings)
    again = researcher.type("offline", "second", *FRAMES, "--json", "best.json", *best)
    assert again.command() == ["report", "best.json"]


def _compare(researcher: Walk, recordings: tuple[str, ...]) -> None:
    """Stricter odds lose constraints, and the last line leads to the pictures."""
    strict = ("--set", "registrar.least_odds=3000", "--no-pages")
    after = researcher.type("batch", *recordings, "--out", "after", "--against", "before", *strict, *FRAMES)
    assert "registrar.least_odds: default → 3000.0" in after.output and "recordings changed" in after.output
    shown = researcher.follow(after, "--out", "both.html")
    assert "wrote both.html" in shown.text and "lost" in (researcher.folder / "both.html").read_text(encoding="utf-8")


def _sweep(researcher: Walk, recordings: tuple[str, ...]) -> list[str]:
    """The words that set the best combination; by its YAML the same is read."""
    out = researcher.folder / "sweep"
    swept = researcher.type("sweep", *recordings, "--out", "sweep", *SWEPT, *FRAMES)
    assert "3 combinations of registrar.least_odds over 2 recordings: 6 runs" in swept.text
    result = json.loads((out / "sweep.json").read_text())
    counts = [(one["false"], one["closed"]) for one in result["combinations"]]
    best = result["best"]
    assert (best["false"], -best["closed"]) == min((false, -closed) for false, closed in counts)
    assert 0 < best["closed"] <= best["revisits"] and counts[2][1] <= counts[0][1]
    assert pyarrow.parquet.read_table(out / "sweep.parquet").num_rows == 6
    again = researcher.type("sweep", *recordings, "--out", "sweep", *SWEPT, *FRAMES)
    assert "6 runs are done already" in again.text
    line = next(line for line in again.output.splitlines() if line.startswith("--set "))
    (researcher.folder / "best.yaml").write_text(best["yaml"])
    assert line.split() == ["--set", *best["set"]]
    return ["--params", "best.yaml", *line.split()]
