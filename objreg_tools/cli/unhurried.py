# SPDX-License-Identifier: Apache-2.0
"""A recording with every frame of it, at no pace: the best that comes out of it, beside which a live run is shown."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from objreg_ros.plausibility.finding import Finding
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.recording.troubles import troubles
from objreg_tools.report.closures.closed_revisits import ClosedRevisits
from objreg_tools.report.run.findings import as_json, find
from objreg_tools.report.run.run_summary import RunSummary

NAME = "every frame"


@dataclass(frozen=True, slots=True)
class Unhurried:
    """The run as JSON, the findings on it, and which revisits its constraints close."""

    summary: dict[str, Any]
    findings: tuple[Finding, ...]
    closed: ClosedRevisits

    @property
    def json(self) -> dict[str, Any]:
        """The summary with the findings, as a report reads it."""
        return {**self.summary, "findings": as_json(self.findings)}


def run_unhurried(
    bag: Path,
    name: str,
    model: str | None,
    labels: str | None,
    camera: str,
    params_file: Path | None,
    changes: Sequence[str],
    inputs: dict[str, str],
    seconds: float | None,
) -> Unhurried:
    """Run the stages over a bag that is called ``name``, with the options of a demo; ``inputs`` are topics by input.

    OSError and ValueError where it has not got these inputs.
    """
    remaps = tuple(f"{name}:={topic}" for name, topic in inputs.items())
    given = RecordedOptions.of(model, labels, camera, params_file, changes, remaps, None, None)
    with given.until(seconds).opened(bag) as opened:
        with tqdm(total=opened.frames, unit="frame", desc=NAME, disable=None, leave=False) as bar:
            run = opened.run(on_frame=lambda count: bar.update(count - bar.n))
        summary = {**opened.summary(run, sys.argv[1:]), "name": f"{name}, {NAME}"}
        found = tuple(find(summary, troubles(opened.source, opened.inputs)))
        closed = RunSummary.of(name, summary, opened.truth).closed_revisits
    click.echo(f"{NAME}: {run.frames} frames, {len(run.closures)} constraints", err=True)
    return Unhurried(summary, found, closed)
