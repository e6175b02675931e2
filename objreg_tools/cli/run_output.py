# SPDX-License-Identifier: Apache-2.0
"""The findings on a run in the terminal, and the exit code for them."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import click

from objreg_ros.data.closures import Rejected
from objreg_ros.plausibility.finding import Finding
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING
from objreg_tools.cli.paths import STANDARD_OUTPUT
from objreg_tools.cli.verbosity import aside, is_verbose
from objreg_tools.offline.run import Run
from objreg_tools.report.closures.closed_revisits import ClosedRevisits
from objreg_tools.report.run.findings import Counts, verdict
from objreg_tools.report.words import number_of

STILL = "all frames have the stamp {} ns, so none closes a loop: record them again with the time in their headers"


@contextmanager
def json_to(file: Path | None) -> Iterator[Callable[[Any], None]]:
    """A function that writes a value as JSON into ``file``, or into standard output where that is ``-``.

    In the latter case all other output within goes to standard error. Without a file nothing is written.
    """
    if file != STANDARD_OUTPUT:
        yield lambda content: None if file is None else write_whole(file, json.dumps(content, indent=1))
        return
    output = sys.stdout
    with redirect_stdout(sys.stderr):
        yield lambda content: click.echo(json.dumps(content, indent=1), file=output)


@aside()
def print_run(run: Run, summary: Mapping[str, Any]) -> None:
    """The results of a run, in numbers."""
    click.echo(
        f"{run.frames} frames, {run.detections} detections, {run.objects} objects, {len(run.closures)} constraints"
    )
    if run.lens:
        click.echo(f"  lens: {run.lens}")
    if run.registered:
        click.echo(f"  {run.registered}")
    if run.mount:
        click.echo(f"  camera: {run.mount}")
    if run.depth_to_colour:
        click.echo(f"  depth is turned against colour by {run.depth_to_colour}; undone")
    if run.depth_lag is not None:
        click.echo(f"  depth is behind colour by {run.depth_lag.text()}")
    if run.depth_noise is not None:
        click.echo(f"  depth noise: {run.depth_noise:.2f} (a Kinect v1 has 1)")
    if run.gravity_from:
        click.echo(
            f"  gravity from {', '.join(f'{name}: {count}' for name, count in sorted(run.gravity_from.items()))}"
        )
    apart = summary["gravity"]["imu_and_picture_apart_deg"]
    if apart is not None:
        click.echo(f"  imu and picture apart: {apart['p50']:.1f}° median, {apart['p95']:.1f}° p95")
    for reason, count in summary["gravity"]["imu_passed_over"].items():
        click.echo(f"  imu {reason}: {count}")
    for title in ("rejected", "dropped"):
        for reason, count in summary[title].items():
            click.echo(f"  {title} {reason}: {count}")
    for complaint in run.complaints.values():
        click.echo(f"  first of them: {complaint}")
    if run.frames > 1 and len({glimpse["stamp_ns"] for glimpse in run.glimpses}) == 1:
        click.echo(f"  ! {STILL.format(run.glimpses[0]['stamp_ns'])}")
    for stage, ms in summary["stage_ms"].items():
        click.echo(f"  {stage}: {ms['p50']:.1f} ms median, {ms['p95']:.1f} ms p95")
    print_memory(summary)
    truth = summary["truth"]
    if truth["count"]:
        degrees, centimetres = truth["rotation_deg"], truth["translation_cm"]
        click.echo(f"  true error: {degrees['median']:.2f}° {centimetres['median']:.1f} cm median, "
                   f"{degrees['max']:.2f}° {centimetres['max']:.1f} cm at most")  # fmt: skip
        shares = ", ".join(f"{truth[name]} {name}" for name in ("strict", "loose", "false"))
        click.echo(f"  of {truth['count']} constraints: {shares}")


@aside()
def print_memory(summary: Mapping[str, Any]) -> None:
    """What a store in a file held and holds, and whether the camera is in the map of an earlier session."""
    before, after = summary["stored"]["before"], summary["stored"]["after"]
    if summary["store"]:
        click.echo(f"  store {summary['store']}: {_held(before)}; now {_held(after)}")
    place = summary["relocalised"]
    if place is not None:
        click.echo(
            f"  relocalised in the map of session {place['session']} from the frame of {place['first_ns']} ns on; "
            f"in the end: {summary['whereabouts']}"
        )
    elif summary["store"] and before.get("keyframes"):
        click.echo(f"  not relocalised: {summary['whereabouts']}")


def _held(counts: Mapping[str, int]) -> str:
    nouns = ("session", "keyframe", "landmark", "closure")
    return ", ".join(number_of(counts[f"{noun}s"], noun) for noun in nouns if f"{noun}s" in counts)


@aside()
def print_trajectory(trajectory: Mapping[str, Any] | None) -> None:
    """How much of the trajectory is in one piece, and its error before and after closures correct it."""
    if trajectory is None:
        return
    sessions, apart = trajectory["sessions"], trajectory["sessions_apart"]
    tied = f" in {sessions} sessions that closures tie together" if sessions > 1 else ""
    click.echo(f"  trajectory ({trajectory['of']}): {trajectory['frames']} frames{tied}")
    if apart:
        click.echo(
            f"  trajectory: {trajectory['frames_apart']} frames in {number_of(apart, 'more session')} are left out: "
            "the track was lost between, and no closures tie them to it"
        )
    error = trajectory["error_cm"]
    if error is not None:
        click.echo(f"  trajectory error: {error['before']:.1f} cm, corrected {error['after']:.1f} cm (RMS)")


def print_reasons(refusals: Iterable[Rejected]) -> None:
    """With -v a line for each refusal: both stamps, the reason and the numbers behind it."""
    for refused in refusals if is_verbose() else ():
        click.echo(f"  {refused.from_ns} to {refused.to_ns} ns: {refused.reason.value}: {refused.detail}")


@aside()
def notify(findings: Iterable[Finding], err: bool = False) -> None:
    """A block for each finding: the symptom, and below it the likely cause and what to do."""
    for finding in findings:
        click.echo(f"! {finding.what}", err=err)
        if finding.cause:
            click.echo(f"    likely: {finding.cause}", err=err)
        if finding.todo:
            click.echo(f"    next: {finding.todo}", err=err)
        if finding.anchor:
            click.echo(f"    more: docs/troubleshooting.md#{finding.anchor}", err=err)


@aside()
def print_next(*command: str) -> None:
    """The command that comes after this one, as it may be typed."""
    click.echo(f"next: {shlex.join(command)}")


def closing_lines(
    summary: Mapping[str, Any],
    findings: Sequence[Finding],
    out: Path,
    own: bool,
    closed: ClosedRevisits | None = None,
) -> Iterator[str]:
    """The end of a demo, whose files are in ``out``: whether it worked, how well, and what to do next.

    ``own`` is whether the recording was the user's, not the simulated room; ``closed`` what its constraints close.
    """
    yield f"With every frame: {verdict(summary, findings, closed)}"
    yield f"Look at {out / 'report.html'}; the nodes' logs are in {out / 'logs'}."
    stopped = not summary["constraints"]
    if stopped and findings:
        yield f"Next: {findings[0].todo}."
    elif own:
        yield "Next: tie the constraints into your mapper, as docs/mappers.md says."
    else:
        yield "Next: `objreg inspect YOUR_RECORDING`, then `objreg demo YOUR_RECORDING`."


def exit_code(summary: Mapping[str, Any]) -> int:
    """0 for a run of which frames got through, `NOTHING` for another."""
    return 0 if Counts.of(summary).frames else NOTHING
