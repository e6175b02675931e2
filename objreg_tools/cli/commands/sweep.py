# SPDX-License-Identifier: Apache-2.0
"""`objreg sweep`: recordings with every combination of values of some parameters, and what each combination finds."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.cli.many.sweep_grid import Combination, Grid, default_of
from objreg_tools.cli.many.sweep_work import Failures, RevisitsFile, Share, shares, split, work
from objreg_tools.cli.progress import frame_bar
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.report.batch.batch_tables import require_pyarrow
from objreg_tools.report.run.revisits import Revisit
from objreg_tools.report.sweep.revisits_of_run import closed_of
from objreg_tools.report.sweep.sweep_page import set_words, sweep_page, verdict
from objreg_tools.report.sweep.sweep_rows import Found, Setting, best_of, ranked
from objreg_tools.report.sweep.sweep_tables import as_json, as_yaml, write_parquet
from objreg_tools.workers import cores, require_dask, spread

RUNS, REVISITS = "runs", "revisits"
ON_CLUSTER = 64  # workers that a cluster is taken to have, when work is parted
HEAD = f"{'closed':>13} {'false':>6} {'constraints':>12}  values"


@click.command()
@options.over_workers
@options.of_run
def command(recordings: tuple[Path, ...], out: Path, workers: int | None, scheduler: str, **given: Any) -> int:
    """Run RECORDINGS with every combination of the values that --set gives: --set registrar.least_odds=20,75,300.

    Commas part values; those of a list parameter are its own, so give it more than once. Values of another --set
    multiply these, to 256 combinations at most. What is detected in a recording is used by all combinations that do not
    change the detector.

    Where a recording has ground truth, it is counted how many revisits each combination closes, and how many of its
    constraints are false. The best has the fewest false ones and then the most revisits. Without truth no best is
    named.

    Writes into OUT a page with curves, report.html, sweep.json, sweep.parquet, and the JSON of every run. What is done
    is not done again. Ends with 3 if a run failed.
    """
    options.require_one_place(workers, scheduler)
    require_dask(), require_pyarrow()
    grid, paths = Grid.of(given["changes"]), list(dict.fromkeys(recordings))
    runs = _runs(grid, out, given)
    names = ", ".join(grid.swept)
    runs_in_all = len(grid) * len(paths)
    click.echo(f"{grid.text} combinations of {names} over {len(paths)} recordings: {runs_in_all} runs", err=True)
    failures = _done(paths, runs, out, workers, scheduler)
    revisits = {path: RevisitsFile(out / REVISITS, runs[0][1]).read(path) or [] for path in paths}
    settings = [_setting(combination, run, revisits, failures, out) for combination, run in runs]
    _write(settings, runs[0][1], grid, out)
    _print(settings, out)
    return NOTHING if any(setting.failed for setting in settings) else 0


def _runs(grid: Grid, out: Path, given: Mapping[str, Any]) -> list[tuple[Combination, BatchWork]]:
    """The work of each combination, in a folder of its own. ValueError for values that are refused."""
    runs = []
    for combination in grid.combinations:
        changes = (*options.ONE_THREAD, *grid.fixed, *combination.changes)
        asked = RecordedOptions.of(**{**given, "changes": changes})
        if asked.settings.of("registrar", RegistrarParams).store:
            raise ValueError("registrar.store: expected none, since each run has its own memory; leave it out")
        runs.append((combination, BatchWork.of(asked, out / RUNS / combination.digest, tuple(sys.argv[1:]))))
    print_ignored(runs[0][1].asked.settings)
    return runs


def _done(
    recordings: Sequence[Path],
    runs: Sequence[tuple[Combination, BatchWork]],
    out: Path,
    workers: int | None,
    scheduler: str,
) -> dict[Path, dict[str, str]]:
    """Do what is not done; why runs failed, by recording and folder, and under `REVISITS` why these did."""
    for _, run in runs:
        run.folder.mkdir(parents=True, exist_ok=True)
    groups: list[Share] = []
    for recording in recordings:
        waiting = [run for _, run in runs if not run.is_done(recording)]
        kept = RevisitsFile(out / REVISITS, runs[0][1])
        groups += shares(recording, waiting, kept if kept.read(recording) is None else None)
    done = len(runs) * len(recordings) - sum(len(group.runs) for group in groups)
    if done:
        click.echo(f"{done} runs are done already", err=True)
    parted = split(groups, ON_CLUSTER if scheduler else workers or cores())
    numbers = {id(share): number for number, share in enumerate(parted)}
    failures: dict[Path, dict[str, str]] = {}
    with frame_bar(len(parted)) as bar:
        for ended in spread(work, parted, workers, scheduler, bar.receive):
            bar.end(numbers[id(ended.item)])
            share, failed = ended.item, ended.value or Failures()
            of_share = dict(failed.runs) | ({REVISITS: failed.revisits} if failed.revisits else {})
            if ended.error is not None:
                of_share = {str(run.folder): str(ended.error) for run in share.runs}
            failures.setdefault(share.recording, {}).update(of_share)
            for why in dict.fromkeys(of_share.values()):
                bar.write(f"! {share.recording.name}: {why}", file=sys.stderr)
    return failures


def _setting(
    combination: Combination,
    run: BatchWork,
    revisits: Mapping[Path, Sequence[Revisit]],
    failures: Mapping[Path, Mapping[str, str]],
    out: Path,
) -> Setting:
    found = []
    for recording, of_recording in revisits.items():
        why = failures.get(recording, {}).get(str(run.folder))
        found.append(_found(run, recording, of_recording, out) if why is None else _failed(recording, why))
    values = combination.parsed
    changed = sum(value != default_of(name) for name, value in values.items())
    return Setting(values, combination.changes, changed, tuple(found))


def _failed(recording: Path, why: str) -> Found:
    return Found(recording.name, str(recording), error=why)


def _found(run: BatchWork, recording: Path, revisits: Sequence[Revisit], out: Path) -> Found:
    try:
        summary = run.read(recording)
    except ValueError as error:
        return _failed(recording, str(error))
    if summary is None:
        return _failed(recording, f"expected its result at {run.file(recording)}, got none")
    if not summary["frames"]:
        return _failed(recording, "no frame got through")
    truth = summary["truth"]
    closed, of = closed_of(revisits, summary)
    counts = {"judged": truth["count"], "loose": truth["loose"], "false": truth["false"]}
    return Found(
        recording.name,
        str(recording),
        str(run.file(recording).relative_to(out)),
        frames=summary["frames"],
        constraints=len(summary["constraints"]),
        **counts,
        revisits=of,
        closed=closed,
        odds=tuple(one["evidence"]["odds"] for one in summary["constraints"] if "odds" in one["evidence"]),
        seconds=summary["batch"]["seconds"],
    )


def _write(settings: Sequence[Setting], run: BatchWork, grid: Grid, out: Path) -> None:
    model = run.made["model"]
    own = {name: value for name, value in run.made.items() if value and name not in grid.swept}
    about = {**own, "model": f"{model['name']} {model['sha256']}"}
    write_parquet(out / "sweep.parquet", settings)
    write_whole(out / "sweep.json", json.dumps(as_json(settings, about), indent=1))
    write_whole(out / "report.html", sweep_page(settings, about))


def _print(settings: Sequence[Setting], out: Path) -> None:
    """Every combination, the best first, and the best as it may be pasted."""
    with aside():
        click.echo(HEAD)
        for setting in ranked(settings):
            click.echo(_line(setting))
    for sentence in verdict(settings):
        click.echo(sentence)
    best = best_of(settings)
    if best is not None:
        click.echo(set_words(best))
        with aside():
            click.echo(as_yaml(best).rstrip())
    click.echo(f"{len(settings)} combinations; look at {out / 'report.html'}")


def _line(one: Setting) -> str:
    closed = f"{one.total('closed')} of {one.total('revisits')}" if one.total("revisits") else "–"
    false = str(one.total("false")) if one.total("judged") else "–"
    failed = f"  ({one.failed} failed)" if one.failed else ""
    return f"{closed:>13} {false:>6} {one.total('constraints'):>12}  {one.text}{failed}"
