# SPDX-License-Identifier: Apache-2.0
"""`objreg try`: from a recording to a page in one command, with what was assumed and what is wrong at its top."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from objreg_ros.plausibility.finding import Finding
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import options
from objreg_tools.cli.browser import open_page
from objreg_tools.cli.looks.assumed import assumed
from objreg_tools.cli.looks.first_look import look
from objreg_tools.cli.paths import OutputPath
from objreg_tools.cli.recorded import BY_TRACKING, Opened, RecordedOptions
from objreg_tools.cli.run_output import exit_code, notify, print_reasons, print_trajectory
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.offline.run import Run
from objreg_tools.recording.troubles import troubles
from objreg_tools.rehearsal import FRAMES
from objreg_tools.report.pair.pair_command import pair_command
from objreg_tools.report.run.findings import as_json, find, simulated_model_on_real, verdict
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.write import write_report

OF_RUN_JSON, OF_PAGE = '"constraints"', "objreg</title>"  # what a file of an earlier run contains
BEGINNING = 1 << 16  # bytes of a file in which a page has its title


@dataclass(frozen=True, slots=True)
class Files:
    """The page and the JSON of a run, in the folder ``out``, named after the recording."""

    page: Path
    json: Path

    @classmethod
    def of(cls, recording: Path, out: Path) -> Files:
        """Those of a recording. ValueError where a file of their names is no page or JSON of a run."""
        place = recording.resolve()
        name = place.name if place.is_dir() else place.stem
        made = cls(out / f"{name}.html", out / f"{name}.json")
        for file, mark in ((made.page, OF_PAGE), (made.json, OF_RUN_JSON)):
            if file.exists() and not _contains(file, mark):
                expected = f"--out: expected nothing but what an earlier run wrote at {file}"
                raise ValueError(f"{expected}, got another file; name another folder")
        return made


def _contains(file: Path, mark: str) -> bool:
    if not file.is_file():
        return False
    with file.open(encoding="utf-8", errors="replace") as read:
        return mark in (read.read(BEGINNING) if file.suffix == ".html" else read.read())


@click.command()
@options.recording
@click.option(
    "--out",
    type=OutputPath(file_okay=False, path_type=Path),
    default=Path(),
    show_default="the current one",
    help="The folder of the page and the JSON, which have the name of the recording.",
)
@click.option("--no-open", is_flag=True, help="Do not show the page in a browser, as is done where there is a display.")
@options.of_run
def command(recording: Path, out: Path, no_open: bool, **given: Any) -> int:
    """From RECORDING to a page in one command: inspect, offline, report.

    Findings on the recording come first, as a camera or a scale of depth that is not its own. Then what was assumed:
    topics, camera, lens, unit and registration of depth, model, odometry, truth. Then the run, and whether it worked.

    Writes NAME.html and NAME.json, where NAME is that of the recording, in place of those of an earlier run.
    Ends with 3 if no frame got through.
    """
    asked = RecordedOptions.of(**given)
    print_ignored(asked.settings)
    files = Files.of(recording, out)
    with asked.opened(recording) as opened:
        seen = look(opened.rehearse, min(FRAMES, opened.frames))
        known = _of_recording(opened)
        said = [*seen.findings, *known]
        notify(said)
        _say_assumed(assumed(opened, seen.run), [note for note in opened.notes if note != BY_TRACKING])
        run = _run(opened)
        summary = opened.summary(run, sys.argv[1:])
        _say_outcome(run, _ordered(summary, known), said)
        findings = _ordered(summary, said)
        click.echo(verdict(summary, findings))
        trajectory = RunSummary.of(recording.name, summary, opened.truth).trajectory()
        print_trajectory(trajectory)
        added = {"assumed": assumed(opened, run), "trajectory": trajectory, "findings": as_json(findings)}
    out.mkdir(parents=True, exist_ok=True)
    write_whole(files.json, json.dumps({**summary, **added}, indent=1))
    _write_page(files)
    _say_page(files, not no_open)
    if run.closures:
        _say_first_pair(summary)
    return exit_code(summary)


def _of_recording(opened: Opened) -> list[Finding]:
    """What is wrong with a recording before any frame is taken, the model that does not fit it among that."""
    model = None if opened.recorded else simulated_model_on_real(opened.setting)
    return [*troubles(opened.source, opened.inputs), *([model] if model else [])]


def _ordered(summary: Mapping[str, Any], known: Sequence[Finding]) -> list[Finding]:
    """All findings on a run, those on its recording first; of one section of the troubleshooting page the first."""
    of_stream = [Finding(**row) for row in summary["stream"]]
    found: dict[str, Finding] = {}
    for finding in (*of_stream, *known, *find(summary, known)):
        found.setdefault(finding.anchor or finding.what, finding)
    return list(found.values())


@aside()
def _say_assumed(rows: Mapping[str, str], notes: Sequence[str]) -> None:
    click.echo("assumed:")
    width = max(map(len, rows))
    for name, text in rows.items():
        click.echo(f"  {name.ljust(width)}  {text}")
    for note in notes:
        click.echo(f"  note: {note}")


def _run(opened: Opened) -> Run:
    with tqdm(total=opened.frames, unit="frame", desc="running", disable=None, leave=False) as bar:
        return opened.run(on_frame=lambda count: bar.update(count - bar.n))


def _say_outcome(run: Run, findings: Sequence[Finding], said: Iterable[Finding]) -> None:
    """What the run adds to what was said before it, and whether it worked."""
    before, after = {finding.anchor for finding in said}, {finding.anchor for finding in findings}
    notify(finding for finding in findings if not finding.anchor or finding.anchor not in before)
    for finding in said:
        if finding.anchor and finding.anchor not in after:
            _say(f"seen before the run, and not found in it: {finding.what}")
    print_reasons(run.refusals)


@aside()
def _say_first_pair(summary: Mapping[str, Any]) -> None:
    """The command that shows the steps of the first closure."""
    start_ns, first = summary["glimpses"][0]["stamp_ns"], summary["constraints"][0]
    seconds = ((first[name] - start_ns) * 1e-9 for name in ("from_ns", "to_ns"))
    click.echo(f"next: {pair_command(summary, *seconds)}")


@aside()
def _say(text: str) -> None:
    click.echo(text)


def _write_page(files: Files) -> None:
    with tqdm(unit="picture", desc="drawing", disable=None, leave=False) as bar:
        write_report(files.page, [files.json], on_picture=bar.update)


def _say_page(files: Files, opens: bool) -> None:
    click.echo(f"wrote {files.page} and {files.json}")
    if not (opens and open_page(files.page)):
        _say(f"open it in a browser: {files.page.resolve().as_uri()}")
