# SPDX-License-Identifier: Apache-2.0
"""`objreg pair`: two frames of a recording registered, with what each step saw and why the answer is yes or no."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from objreg_ros import share
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import Detections
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.gate.likelihood import BEFORE
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import options
from objreg_tools.cli.commands.inspect import columns
from objreg_tools.cli.looks.moments import (
    KeepsFrames,
    Remembering,
    first_stamp_ns,
    frame_at,
    keyframe_of,
    records_about,
)
from objreg_tools.cli.looks.moments import stamp_of as stamp_ns_of
from objreg_tools.cli.paths import OutputPath
from objreg_tools.cli.recorded import Opened, RecordedOptions
from objreg_tools.cli.run_output import json_to
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.offline.stages import Stages
from objreg_tools.rehearsal import SeesNothing
from objreg_tools.report.closures.weighed_evidence import EVIDENCE, with_unit
from objreg_tools.report.pair.pair_page import Seen, pair_page
from objreg_tools.report.pair.registered_pair import RegisteredPair, register_pair
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.words import reading

ASKED = ("model", "labels", "camera", "params_file", "changes", "remaps", "detections")


@click.command()
@options.recording
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@options.json_out
@click.option(
    "--page", type=OutputPath(dir_okay=False, path_type=Path), metavar="FILE.html", help="The same as a page."
)
@click.option("--keyframes", is_flag=True, help="Fuse the frames about each time into a keyframe, as a run does.")
@options.model
@options.detections
@options.labels
@options.camera
@options.change
@options.params
@options.remap
def command(
    recording: Path, first: str, second: str, json_file: Path | None, page: Path | None, keyframes: bool, **given: Any
) -> None:
    """Register the two frames of RECORDING nearest to the times A and B, and show what each step saw.

    A and B are seconds since the first frame, or stamps in ns. Shows the objects and features of both, what was
    proposed and what became of it, the verdict with the terms of its odds and, where there is truth, the true error.

    Each frame stands by itself, and nothing confirms what the two say: a run has more frames a place, and may be surer.
    Whether the camera is what the stream says is not asked here: that is what `objreg try` does.
    """
    asked = RecordedOptions.of(**{name: given[name] for name in ASKED}, odometry=None, max_frames=None)
    print_ignored(asked.settings)
    with asked.opened(recording) as opened, json_to(json_file) as write_json:
        start_ns = first_stamp_ns(opened)
        stamps_ns = _stamp("A", first, start_ns), _stamp("B", second, start_ns)
        frames, detections = _frames(opened, stamps_ns)
        params = asked.settings.of("registrar", RegistrarParams)
        chosen = [frame_at(frames, stamp_ns, start_ns) for stamp_ns in stamps_ns]
        one, two = (keyframe_of(frame, frames, params, keyframes) for frame in chosen)
        found = register_pair(one, two, params, opened.truth.between(one.stamp_ns, two.stamp_ns))
        summary = {"recording": str(recording.resolve()), "start_ns": start_ns, **found.summary}
        print_pair(summary)
        click.echo(verdict_of(summary))
        write_json(summary)
        if page is not None:
            write_whole(
                page, pair_page(recording.resolve().name, summary, found, _seen(opened, found, frames, detections))
            )
            click.echo(f"wrote {page}; open it in a browser, it needs no network")


def _stamp(name: str, text: str, start_ns: int) -> int:
    try:
        return stamp_ns_of(text, start_ns)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def _frames(opened: Opened, stamps_ns: Sequence[int]) -> tuple[list[Frame], dict[int, Detections]]:
    """The frames about two times, and what the detector found in the pictures."""
    settings, kept = opened.asked.settings, KeepsFrames()
    detector = settings.of("detector", DetectorParams)
    detects = Remembering(SeesNothing() if opened.recorded else Detector.of(detector, share.model))
    stages = Stages(detects, Segmenter(settings.of("segmenter", SegmenterParams)), kept)
    with tqdm(unit="frame", desc="looking at frames", disable=None, leave=False) as bar:
        opened.run_through(records_about(opened, stamps_ns), stages, lambda count: bar.update(count - bar.n))
    return kept.frames, detects.seen


def _seen(
    opened: Opened, found: RegisteredPair, frames: Sequence[Frame], detections: Mapping[int, Detections]
) -> list[Seen | None]:
    """The picture of each frame with what was detected in it; None where it cannot be read."""
    rectified = opened.asked.settings.of("segmenter", SegmenterNodeParams).rectified
    album = Album(opened.source, opened.inputs, rectified)
    seen: list[Seen | None] = []
    for keyframe in (found.first, found.second):
        image = album.at(keyframe.stamp_ns)
        boxes = min(detections.values(), key=lambda one: abs(one.stamp_ns - keyframe.stamp_ns), default=None)
        seen.append(None if image is None else Seen(image, None if boxes is None else album.rectified(boxes)))
    return seen


@aside()
def print_pair(summary: Mapping[str, Any]) -> None:
    """The pair as tables."""
    for name, frame in zip("AB", summary["frames"], strict=True):
        seconds = (frame["stamp_ns"] - summary["start_ns"]) * 1e-9
        objects = ", ".join(f"{item['label']} ({item['points']} points)" for item in frame["objects"]) or "no objects"
        counts = f"{frame['features']} features, {frame['keypoints']} keypoints"
        click.echo(f"{name}  {seconds:.3f} s, {frame['stamp_ns']} ns: {objects}; {counts}")
    click.echo(f"{summary['keypoint_matches']} keypoints match\n")
    _say_hypotheses(summary["hypotheses"])
    _say_candidates(summary["candidates"])
    _say_odds(summary["odds"])


def verdict_of(summary: Mapping[str, Any]) -> str:
    """What became of the pair, in one line."""
    error = summary["error"]
    off = "" if error is None else f"; off by {error['rotation_deg']:.2f}° and {error['translation_cm']:.1f} cm"
    said = "accepted" if summary["accepted"] else f"refused: {summary['reason']}: {summary['detail']}"
    return said + off


def _say_hypotheses(rows: Sequence[Mapping[str, Any]]) -> None:
    if rows:
        lines = [(row["proposer"], str(row["asked"]), str(row["finished"])) for row in rows]
        click.echo(columns(("proposer", "hypotheses", "finished"), lines) + "\n")


def _say_candidates(rows: Sequence[Mapping[str, Any]]) -> None:
    head = ("#", "proposers", "V", "inliers", "violations", "grey", "objects", "odds", "off by", "what became of it")
    lines = [(str(number), *candidate_cells(row), row["became"]) for number, row in enumerate(rows, 1)]
    if rows:
        click.echo(columns(head, lines) + "\n")


def candidate_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """A candidate as the cells of a table."""
    error, grey = row["error"], row["correlation"]
    return (
        ", ".join(row["proposers"]),
        f"{row['score']:.2f}",
        f"{row['inliers']:.2f}",
        f"{row['violations']:.3f}",
        "" if grey is None else f"{grey:.2f}",
        ", ".join(row["matched"]) or "-",
        reading(row["odds"]),
        "" if error is None else f"{error['rotation_deg']:.1f}° {error['translation_cm']:.1f} cm",
    )


def _say_odds(odds: Mapping[str, Any] | None) -> None:
    if odds is None:
        return
    lines = [
        (term["phrase"], with_unit(term["kind"], term["reading"]), f"{term['weight']:+.2f}") for term in odds["terms"]
    ]
    total = ("sum: odds", reading(odds["odds"]), f"{odds['sum']:+.2f}")
    asked = ("asked for", f"{odds['least_odds']:g}", f"{odds['least']:+.2f}")
    rows = [(EVIDENCE[BEFORE].text, "", f"{odds['prior']:+.2f}"), *lines, total, asked]
    click.echo(columns(("evidence of the best", "reading", "weight"), rows) + "\n")
