# SPDX-License-Identifier: Apache-2.0
"""`objreg batch`: many recordings, over the cores of this machine or those of a cluster."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.batch_work import BatchWork
from objreg_tools.cli.paths import OutputPath, RecordingPath
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.report.batch.batch_page import batch_page, totals
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_tables import batch_tables, require_pyarrow
from objreg_tools.workers import require_dask, spread

PAGE = "report.html"
ONE_THREAD = ("registrar.threads=1", "detector.threads=1")
HEAD = f"{'recording':32} {'frames':>7} {'constraints':>12} {'false':>6} {'s':>7}"


@click.command()
@click.argument(
    "recordings", nargs=-1, required=True, type=RecordingPath(path_type=Path, resolve_path=True), metavar="RECORDINGS…"
)
@click.option(
    "--out",
    required=True,
    type=OutputPath(file_okay=False, path_type=Path, resolve_path=True),
    help="The folder of the results; all workers have to see it, and the recordings, at the same path.",
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes of this machine; one for each core by default.")
@click.option("--scheduler", default="", metavar="tcp://HOST:PORT", help="A Dask cluster in place of this machine.")
@options.of_run
def command(recordings: tuple[Path, ...], out: Path, workers: int | None, scheduler: str, **given: Any) -> int:
    """Run RECORDINGS as `objreg offline` does, several at once, one thread each.

    Writes into OUT the JSON of every recording, all of them together as Parquet (recordings, constraints, refusals) and
    a page over them, report.html. The results are the same on any number of workers.

    What is done is not done again by the same command, unless the settings, the program or the recording have changed
    since. A recording that fails stops no other. Ends with 3 if one failed or none of its frames got through.
    """
    if scheduler and workers is not None:
        raise click.UsageError("expected --workers or --scheduler, got both; a cluster has the workers that it has")
    require_dask(), require_pyarrow()
    asked = RecordedOptions.of(**{**given, "changes": (*ONE_THREAD, *given["changes"])})
    _require_own_memory(asked)
    print_ignored(asked.settings)
    out.mkdir(parents=True, exist_ok=True)
    work, paths = BatchWork.of(asked, out, tuple(sys.argv[1:])), list(dict.fromkeys(recordings))
    rows = _written(work, paths, _failures(work, _waiting(work, paths), workers, scheduler))
    _print_summary(rows, out)
    return NOTHING if any(row.error or not row.frames for row in rows) else 0


def _require_own_memory(asked: RecordedOptions) -> None:
    if asked.settings.of("registrar", RegistrarParams).store:
        raise ValueError("registrar.store: expected none, since each recording has its own memory; leave it out")


def _waiting(work: BatchWork, recordings: Sequence[Path]) -> list[Path]:
    """The recordings that are to be done; reports which are done already, and which are done anew and why."""
    differing = {recording: _differing(work, recording) for recording in recordings}
    done = sum(names == [] for names in differing.values())
    changed = Counter(name for names in differing.values() for name in names or ())
    if done:
        click.echo(f"{done} of {len(recordings)} recordings are done already", err=True)
    if changed:
        anew = sum(bool(names) for names in differing.values())
        click.echo(f"! {anew} were made otherwise and are done anew: {', '.join(sorted(changed))} changed", err=True)
    return [recording for recording, names in differing.items() if names != []]


def _differing(work: BatchWork, recording: Path) -> list[str] | None:
    """As `BatchWork.differing`; what is there and is no result is named, and counts as none."""
    try:
        return work.differing(recording)
    except ValueError as error:
        click.echo(f"! {error}; it is made anew", err=True)
        return None


def _failures(work: BatchWork, waiting: Sequence[Path], workers: int | None, scheduler: str) -> dict[Path, Exception]:
    """Do what is waiting; which recordings failed, and how."""
    if waiting:
        click.echo("starting the workers", err=True)
    failures: dict[Path, Exception] = {}
    with tqdm(total=len(waiting), unit="recording", disable=None, leave=False) as bar:
        for done in spread(work, waiting, workers, scheduler):
            bar.update()
            if done.error is not None:
                failures[done.item] = done.error
                bar.write(f"! {done.item.name}: {Row.failed(done.item, done.error).error}", file=sys.stderr)
    return failures


def _written(work: BatchWork, recordings: Sequence[Path], failures: dict[Path, Exception]) -> list[Row]:
    """Tables and page over all recordings; the rows of these."""
    rows = []
    with batch_tables(work.folder) as tables:
        for row, summary in _status(work, recordings, failures):
            tables.add_recording(row, summary)
            rows.append(row)
    model = work.made["model"]
    made = {**work.made, "model": f"{model['name']} {model['sha256']}"}
    write_whole(work.folder / PAGE, batch_page(rows, {name: value for name, value in made.items() if value}))
    return rows


def _status(
    work: BatchWork, recordings: Sequence[Path], failures: dict[Path, Exception]
) -> Iterator[tuple[Row, dict[str, Any] | None]]:
    for recording in recordings:
        try:
            summary = _result(work, recording, failures)
        except Exception as error:
            yield Row.failed(recording, error), None
        else:
            yield Row.of(recording, work.file(recording).name, summary), summary


def _result(work: BatchWork, recording: Path, failures: dict[Path, Exception]) -> dict[str, Any]:
    """The JSON of a recording; raises what kept it from being made."""
    if recording in failures:
        raise failures[recording]
    summary = work.read(recording)
    if summary is None:
        raise OSError(f"expected its result at {work.file(recording)}, got none; the workers must share that folder")
    return summary


def _print_summary(rows: Sequence[Row], out: Path) -> None:
    """The table of all recordings, and their sums."""
    with aside():
        click.echo(HEAD)
        for row in rows:
            click.echo(f"{row.name:32} {row.error}" if row.error else _line(row))
    sums = ", ".join(f"{count} {name}" for name, count in totals(rows).items())
    click.echo(f"{sums}; look at {out / PAGE}")


def _line(row: Row) -> str:
    false = "–" if row.false is None else row.false
    return f"{row.name:32} {row.frames:>7} {row.constraints:>12} {false:>6} {row.seconds or 0:>7.1f}"
