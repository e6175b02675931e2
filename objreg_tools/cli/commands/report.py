# SPDX-License-Identifier: Apache-2.0
"""`objreg report`: pictures and tables of runs on one page."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import click

from objreg_tools.cli import options
from objreg_tools.cli.commands import offline
from objreg_tools.cli.paths import OutputPath, RecordingPath
from objreg_tools.report.write import write_report


@click.command()
@click.argument("runs", nargs=-1, required=True, type=RecordingPath(path_type=Path), metavar="RUN.json|REC…")
@click.option("--out", default="report.html", type=OutputPath(dir_okay=False, path_type=Path), help="The page.")
@options.of_run
@click.pass_context
def command(context: click.Context, runs: tuple[Path, ...], out: Path, **given: Any) -> int:
    """Write one HTML page about runs: the JSON of `objreg offline`, or recordings, which are run now.

    It opens offline and holds the trajectory against the truth, a timeline of closures and refusals, pictures of
    registrations, the object map and the times.

    All options but --out are for recordings, and as in `objreg offline`; with nothing but JSON they are refused.
    """
    for missing in [run for run in runs if not run.expanduser().exists()]:
        raise FileNotFoundError(
            f"expected the JSON of `objreg offline --json` or a recording, got nothing at {missing}"
        )
    if any(given.values()) and all(_is_json(run) for run in runs):
        raise ValueError("expected a recording that is run with these options, got runs that are done; leave them out")
    with tempfile.TemporaryDirectory() as folder:
        files, code = [], 0
        for number, run in enumerate(runs):
            file = run if _is_json(run) else Path(folder, f"{number}.json")
            if file is not run:
                code |= context.invoke(offline.command, recording=run, json_file=file, **given)
            files.append(file)
        for lacking in write_report(out, files):
            click.echo(f"! {lacking}", err=True)
    click.echo(f"wrote {out}; open it in a browser, it needs no network")
    return code


def _is_json(run: Path) -> bool:
    return run.suffix == ".json"
