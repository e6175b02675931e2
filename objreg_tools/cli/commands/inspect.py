# SPDX-License-Identifier: Apache-2.0
"""`objreg inspect`: what is in a recording and what the graph would use of it, or what a store holds."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click

from objreg_ros.memory.store_file import is_store
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.looks.first_look import look
from objreg_tools.cli.paths import OutputPath
from objreg_tools.cli.run_output import notify, print_next
from objreg_tools.recording import Recording, open_recording
from objreg_tools.recording.camera_from_text import with_camera
from objreg_tools.recording.inputs import GRAPH_TOPICS, Inputs, alternatives, choose_inputs, parse_remaps
from objreg_tools.recording.mounts import first_frames
from objreg_tools.recording.recorded_detections import recorded_detections
from objreg_tools.recording.summary import describe_lens, describe_topics
from objreg_tools.recording.tf_odometry import by_transforms, with_transforms
from objreg_tools.recording.troubles import warnings
from objreg_tools.rehearsal import rehearse
from objreg_tools.report.live_pictures import write_picture
from objreg_tools.report.store.portraits import portraits
from objreg_tools.report.store.store_drawing import draw
from objreg_tools.report.store.store_page import store_page
from objreg_tools.report.store.store_summary import describe, survey
from objreg_tools.truth import Truth

FILE = OutputPath(dir_okay=False, path_type=Path)


@click.command()
@options.recording
@options.remap
@options.camera
@click.option("--picture", type=FILE, metavar="FILE.png", help="Draw the sessions of a store and its objects.")
@click.option("--page", type=FILE, metavar="FILE.html", help="The same as a page, with what moved.")
def command(recording: Path, remaps: tuple[str, ...], camera: str, picture: Path | None, page: Path | None) -> int:
    """Show what is in RECORDING, which topics the graph would use, and what would go wrong.

    Takes its first frames as a run would, without a detector, and reports where the stream differs from what it states.
    Ends with 3 where the graph cannot run on it, or would drop every frame.

    RECORDING may also be a store of the registrar: then it shows its sessions, labels and objects, and what moved.
    """
    if is_store(recording):
        _say_store(recording, picture, page)
        return 0
    for option, file in {"--picture": picture, "--page": page}.items():
        if file is not None:
            raise ValueError(f"{option}: expected a store of the registrar, whose objects it draws, got {recording}")
    asked = parse_remaps(remaps)
    with open_recording(recording) as opened:
        source = with_transforms(with_camera(opened, camera, asked))
        inputs = choose_inputs(source.topics, asked, frames=first_frames(source))
        _say_what_it_is(source)
        _say_topics(source)
        _say_inputs(inputs)
        _say_other_cameras(alternatives(source.topics, first_frames(source), asked))
        _say_detections(source)
        _say_lens(source, inputs)
        _say_truth(source, inputs)
        for note in by_transforms(source, inputs):
            click.echo(note)
        seen = look(lambda show: rehearse(source, inputs, on_frame=show)) if inputs.complete else None
        notify([*warnings(source, inputs), *(seen.findings if seen else ())])
    if seen is None or not seen.runs:
        return NOTHING
    options = [f"--remap={remap}" for remap in remaps] + ([f"--camera={camera}"] if camera else [])
    print_next("objreg", "offline", str(recording), *options, "--json", "run.json")
    return 0


def _say_store(store: Path, picture: Path | None, page: Path | None) -> None:
    found = survey(store)
    click.echo(describe(found))
    pictures = portraits(store, found.sightings) if picture or page else {}
    if picture is not None:
        write_picture(picture, draw(found, pictures))
        click.echo(f"  drawn into {picture}")
    if page is not None:
        write_whole(page, store_page(found, pictures))
        click.echo(f"  written into {page}")
    left_out = len(found.landmarks) - len(pictures)
    if (picture or page) and left_out:
        click.echo(f"  {left_out} objects have no picture: they were seen least, or their keyframes cannot be read")


def _say_what_it_is(source: Recording) -> None:
    start = datetime.fromtimestamp(source.start_ns * 1e-9, UTC)
    records = sum(topic.count for topic in source.topics.values())
    begins = f" from {start:%Y-%m-%d %H:%M:%S} UTC" if records else ""
    click.echo(f"{source.path}: {source.kind}, {source.seconds:.2f} s{begins}, {records} records\n")


def _say_topics(source: Recording) -> None:
    rows = [
        (line.topic, line.msgtype.replace("/msg/", "/"), str(line.count), _rate(line.rate), line.what)
        for line in describe_topics(source)
    ]
    click.echo(columns(("topic", "type", "count", "Hz", "first message"), rows) + "\n")


def _rate(rate: float | None) -> str:
    return "" if rate is None else f"{rate:.1f}"


def _say_inputs(inputs: Inputs) -> None:
    chosen = inputs.chosen()
    rows = [(GRAPH_TOPICS[name], chosen.get(name, "-")) for name in GRAPH_TOPICS]
    click.echo(columns(("input of the graph", "topic that it would use"), rows) + "\n")


def _say_other_cameras(others: Sequence[Inputs]) -> None:
    for other in others:
        remaps = " ".join(f"--remap {name}:={topic}" for name, topic in other.outright_camera.items())
        click.echo(f"another camera that could be meant: {remaps}")
    if others:
        click.echo()


def _say_detections(source: Recording) -> None:
    found = recorded_detections(source.topics)
    for one in found:
        names = f", with the names of {one.names}" if one.names else ""
        click.echo(f"detections that were recorded: --detections {one.topic} runs with them{names}")
    if found:
        click.echo()


def _say_lens(source: Recording, inputs: Inputs) -> None:
    lens = describe_lens(source, inputs)
    if lens:
        click.echo(f"lens: {lens}\n")


def _say_truth(source: Recording, inputs: Inputs) -> None:
    truth = Truth.of(source, inputs.ground_truth)
    if truth.poses:
        click.echo(f"ground truth: {len(truth.poses)} poses, {truth.length:.2f} m\n")
    for note in truth.notes:
        click.echo(f"! {note}")


def columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in plain text, two spaces between the columns."""
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    lines = [head, ["-" * width for width in widths], *rows]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )
