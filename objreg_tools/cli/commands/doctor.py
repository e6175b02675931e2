# SPDX-License-Identifier: Apache-2.0
"""`objreg doctor`: whether a run can work on this machine, and what is missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby

import click

from objreg_tools.cli import BROKEN
from objreg_tools.cli.checks import Check, all_checks
from objreg_tools.cli.verbosity import aside

GOOD, ADVICE, PROBLEM = " ", "-", "!"


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print all of it as JSON.")
def command(as_json: bool) -> int:
    """Check whether a run can work here: libraries, packages, models, ROS, disk and what is compiled.

    What stops a run is marked with !, what a run does without with -, each with what to do. Ends with 0 where
    `objreg offline` can work, with 1 where it cannot. For bug reports.
    """
    checks = list(all_checks())
    stopping = [check for check in checks if check.stops]
    if as_json:
        click.echo(json.dumps({"can_run": not stopping, "checks": [asdict(check) for check in checks]}, indent=1))
    else:
        _say(checks)
        click.echo("\n".join([verdict(stopping), *(f"{check.name}: {check.todo}" for check in stopping)]))
    return BROKEN if stopping else 0


@aside()
def _say(checks: Sequence[Check]) -> None:
    """A line a check, and below it what to do, by sections."""
    width = max(len(check.name) for check in checks)
    for section, group in groupby(checks, lambda check: check.section):
        click.echo(section)
        for check in group:
            mark = PROBLEM if check.stops else ADVICE if check.todo else GOOD
            click.echo(f"{mark} {check.name.ljust(width)}  {check.found}")
            if check.todo:
                click.echo(f"  {' ' * width}  -> {check.todo}")


def verdict(stopping: Sequence[Check]) -> str:
    """The verdict."""
    if not stopping:
        return "A run can work here."
    return f"No run can work here before this is mended ({len(stopping)}):"
