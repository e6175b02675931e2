# SPDX-License-Identifier: Apache-2.0
"""`objreg batch`: many recordings, over the cores of this machine or those of a cluster."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.many.batch_work import BatchWork, read_result
from objreg_tools.cli.paths import InputPath
from objreg_tools.cli.progress import frame_bar
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.run_output import print_next
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.report.batch.batch_comparison import Change, change, ordered, other_result, settings_of
from objreg_tools.report.batch.batch_page import batch_page, totals
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_tables import batch_tables, require_pyarrow
from objreg_tools.workers import require_dask, spread

PAGE = "report.html"
HEAD = f"{'recording':32} {'frames':>7} {'revisits':>9} {'constraints':>12} {'false':>6} {'s':>7}"


@click.command()
@options.over_workers
@click.option(
    "--against",
    type=InputPath(exists=True, file_okay=False, path_type=Path, resolve_path=True),
    metavar="FOLDER",
    help="The folder of another batch: what changed since then, recording by recording.",
)
@click.option("--pages/--no-pages", default=True, show_default=True, help="Write a page of each recording, 3 to 15 MB.")
@options.of_run
def command(
    recordings: tuple[Path, ...],
    out: Path,
    workers: int | None,
    scheduler: str,
    against: Path | None,
    pages: bool,
    **given: Any,
) -> int:
    """Run RECORDINGS as `objreg offline` does, several at once, one thread each.

    Writes into OUT the JSON and the page of every recording, all of them together as Parquet (recordings, constraints,
    refusals) and a page over them, report.html. The results are the same on any number of workers.

    What is done is not done again by the same command, unless the settings, the program or the recording have changed
    since. A recording that fails stops no other. Ends with 3 if one failed or none of its frames got through.
    """
    options.require_one_place(workers, scheduler)
    require_dask(), require_pyarrow()
    asked = RecordedOptions.of(**{**given, "changes": (*options.ONE_THREAD, *given["changes"])})
    _require_own_memory(asked)
    print_ignored(asked.settings)
    out.mkdir(parents=True, exist_ok=True)
    work, paths = BatchWork.of(asked, out, tuple(sys.argv[1:]), pages), list(dict.fromkeys(recordings))
    rows, changes = _written(work, paths, _failures(work, _waiting(work, paths), workers, scheduler), against)
    _print_summary(rows, out)
    if against is not None:
        _print_changes(changes, against, out)
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
    return [recording for recording, names in differing.items() if names != [] or work.lacks_page(recording)]


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
    with frame_bar(len(waiting)) as bar:
        for done in spread(work, waiting, workers, scheduler, bar.receive):
            bar.end(waiting.index(done.item))
            if done.error is not None:
                failures[done.item] = done.error
                bar.write(f"! {done.item.name}: {Row.failed(done.item, done.error).error}", file=sys.stderr)
            elif done.value:
                bar.write(f"! {done.item.name}: {done.value}", file=sys.stderr)
    return failures


def _written(
    work: BatchWork, recordings: Sequence[Path], failures: dict[Path, Exception], against: Path | None
) -> tuple[list[Row], list[Change]]:
    """Tables and page over all recordings; the rows of these, and what changed since another batch."""
    rows, changes = list[Row](), list[Change]()
    with batch_tables(work.folder) as tables:
        for row, summary in _status(work, recordings, failures):
            tables.add_recording(row, summary)
            rows.append(row)
            if against is not None:
                changes.append(_change(work, row, summary, against, recordings))
    model = work.made["model"]
    made = {**work.made, "model": f"{model['name']} {model['sha256']}"}
    about = {name: value for name, value in made.items() if value}
    write_whole(work.folder / PAGE, batch_page(rows, about, str(against or ""), changes))
    return rows, changes


def _change(
    work: BatchWork, row: Row, summary: dict[str, Any] | None, against: Path, recordings: Sequence[Path]
) -> Change:
    file = other_result(against, work.file(Path(row.recording)).name, recordings)
    try:
        return change(row, summary, read_result(file) if file else None)
    except ValueError as error:
        return change(row, summary, None, str(error))


def _status(
    work: BatchWork, recordings: Sequence[Path], failures: dict[Path, Exception]
) -> Iterator[tuple[Row, dict[str, Any] | None]]:
    for recording in recordings:
        try:
            summary = _result(work, recording, failures)
        except Exception as error:
            yield Row.failed(recording, error), None
        else:
            row = Row.of(recording, work.file(recording).name, summary)
            yield row.with_page(work.page(recording)), summary


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
            for finding in row.findings:
                click.echo(f"  ! {finding['what']}")
    sums = ", ".join(f"{name}: {count}" for name, count in totals(rows).items())
    click.echo(f"{sums}; look at {out / PAGE}")


def _line(row: Row) -> str:
    closed = f"{_count(row.revisits):>9} {row.constraints:>12} {_count(row.false):>6}"
    return f"{row.name:32} {row.frames:>7} {closed} {row.seconds or 0:>7.1f}"


def _print_changes(changes: Sequence[Change], against: Path, out: Path) -> None:
    """The recordings that changed, and the command that shows why the first of them did."""
    changed = [one for one in ordered(changes) if one.is_changed]
    alone = sum(one.before is None for one in changes)
    with aside():
        for name, values in settings_of(changes).items():
            click.echo(f"  {name}: {'; '.join(f'{before} → {now}' for before, now in sorted(values))}")
        for one in changed:
            click.echo(f"  {one.row.name:32} {_changed(one)}")
    lacking = f", {alone} are not in it" if alone else ""
    click.echo(f"against {against}: {len(changed)} of {len(changes)} recordings changed{lacking}")
    first = next((one for one in changed if not one.row.error), None)
    file = other_result(against, first.row.file, [Path(one.row.recording) for one in changes]) if first else None
    if first and file:
        print_next("objreg", "report", str(file), str(out / first.row.file))


def _changed(one: Change) -> str:
    if one.row.error or one.before is None:
        return "failed now"
    before, row = one.before, one.row
    false = "" if before.false == row.false else f", false {_count(before.false)} → {_count(row.false)}"
    return f"constraints {before.constraints} → {row.constraints} (+{one.gained} −{one.lost}){false}"


def _count(value: int | None) -> str:
    return "–" if value is None else str(value)
