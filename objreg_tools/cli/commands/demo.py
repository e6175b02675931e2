# SPDX-License-Identifier: Apache-2.0
"""`objreg demo`: every frame of a recording, then the live graph at its real rate; a page, a table and pictures."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click

from objreg_ros import share
from objreg_ros.bridge.camera.calibration import absolute
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_ros.data.closure_fields import fields_of
from objreg_ros.data.images import ColourImage, Intrinsics
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import mounting, quaternion_from_rotation
from objreg_ros.registrar.params import RegistrarNodeParams
from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import live_table, options
from objreg_tools.cli.live import STAGES, Live, Setup, run_live
from objreg_tools.cli.paths import OutputPath, RecordingPath
from objreg_tools.cli.played import as_rosbag2, simulated_room
from objreg_tools.cli.run_output import closing_lines, exit_code, notify, print_reasons
from objreg_tools.cli.settings import parse_change, print_ignored, read_settings, ros_argument
from objreg_tools.cli.unhurried import run_unhurried
from objreg_tools.cli.verbosity import aside
from objreg_tools.offline.run import constraint_with_error
from objreg_tools.recording import Recording, open_recording
from objreg_tools.recording.camera_from_text import with_camera
from objreg_tools.recording.inputs import Inputs, choose_inputs, parse_remaps
from objreg_tools.recording.mounts import TRANSFORMS, camera_on_body, first_frames
from objreg_tools.recording.tf_odometry import with_transforms
from objreg_tools.recording.troubles import FOLDER, troubles
from objreg_tools.report.closures.closed_revisits import ClosedRevisits
from objreg_tools.report.live_pictures import draw_sight, draw_trajectory
from objreg_tools.report.run.about import about
from objreg_tools.report.run.findings import as_json, find, setting, verdict
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.write import with_odometry, write_report
from objreg_tools.truth import Truth, summarise

SIMULATED = {"registrar.covariance_calibration": "0.01", "detector.model": share.EMBEDDED}
"""The camera is as its calibration says, and a model knows the objects."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """The command line."""

    recording: Path | None
    model: str | None
    labels: str | None
    params_file: Path | None
    changes: tuple[str, ...]
    remaps: tuple[str, ...]
    seconds: float | None
    rate: float
    lossless: bool
    out: Path
    camera: str = ""


@click.command()
@click.argument("recording", type=RecordingPath(path_type=Path), required=False)
@options.model
@options.labels
@options.camera
@options.params
@options.change
@options.remap
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="Play only this many seconds.")
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True, help="Speed.")
@click.option("--lossless", is_flag=True, help="Live too, wait for every frame instead of keeping the pace.")
@click.option(
    "--out",
    type=OutputPath(file_okay=False, path_type=Path),
    default=Path("out/demo"),
    show_default=True,
    help="Where everything is written.",
)
def command(**asked: Any) -> int:
    """Run RECORDING (or a simulated room), then play it through three live nodes, and show what came out of both.

    The first run takes every frame, without ROS, as `objreg offline` does: what the recording gives where there is time
    for all of it. The live one keeps the pace of the recording, and leaves out what the machine is too slow for.

    Ends with the counters of every node, latencies, constraints and their true error, and with pictures in the folder
    of --out. The inputs of a recording that is no rosbag2 are written as one first. The last lines report whether it
    worked, how well, and what to do next. Ends with 3 if no frame got through.
    """
    return run(DemoOptions(**asked))


def run(asked: DemoOptions) -> int:
    """The whole demo and its exit code; ValueError or OSError if it cannot be, or if the counters do not balance."""
    own = asked.recording is not None
    asked = asked if asked.recording else calibrated(asked)
    recording = asked.recording or simulated_room(asked.out)
    inputs, camera = _inputs(recording, asked), camera_asked(asked)
    bag = as_rosbag2(recording, inputs, asked.out, asked.seconds)
    page, name = asked.out / "report.html", recording.resolve().name
    given = asked.model, asked.labels, camera, asked.params_file, asked.changes, inputs.outright, asked.seconds
    first = run_unhurried(bag, name, *given)
    files = [_write_json(asked.out / "every_frame.json", first.json)]
    write_report(page, files)
    _say(f"wrote {page}; the same live now, which comes below it")
    with open_recording(bag) as opened:
        source = with_transforms(with_camera(opened, camera, inputs.outright))
        logs, summary = asked.out / "logs", begun_summary(asked, recording, source, inputs)
        live = run_live(bag, setup_of(asked, inputs, camera), logs, _say)
        truth = Truth.of(source, inputs.ground_truth)
        for note in truth.notes:
            _say(f"! {note}")
        summary = summary_of({**summary, "logs": str(logs.resolve())}, live, truth)
        findings, closed = find(summary, troubles(source, inputs)), closed_by(summary, source, inputs, truth)
        files.append(_write_json(asked.out / "demo.json", {**summary, "findings": as_json(findings)}))
        _draw(asked.out, live, truth, source, inputs)
        sent = _sent(source, inputs, asked.seconds, live)
    write_report(page, files, compared_last=True)
    _say(f"wrote {page}")
    with aside():
        click.echo("\n".join(live_table.lines(live, sent, summarise(truth.errors(live.closures)))))
        print_reasons(live.refusals)
        click.echo()
    live_table.require_balance(live, sent)
    notify(findings)
    click.echo(f"Live: {verdict(summary, findings, closed)}")
    click.echo("\n".join(closing_lines(first.summary, first.findings, asked.out, own, first.closed)))
    return exit_code(summary)


def closed_by(summary: Mapping[str, Any], source: Recording, inputs: Inputs, truth: Truth) -> ClosedRevisits:
    """What the constraints of the run close, by the recording's odometry or its truth."""
    glimpses = with_odometry(summary["glimpses"], source, inputs.odom, mounting(summary["T_base_camera"]))
    return RunSummary.of("demo", {**summary, "glimpses": glimpses}, truth).closed_revisits


def _write_json(file: Path, summary: Mapping[str, Any]) -> Path:
    write_whole(file, json.dumps(summary, indent=1))
    return file


def begun_summary(asked: DemoOptions, recording: Path, source: Recording, inputs: Inputs) -> dict[str, Any]:
    """The fields of the JSON on the recording, of which ``source`` was played, and on how the run was made."""
    changed = read_settings(asked.params_file, asked.changes).changed()
    return {
        "about": about(recording, model_of(asked), changed, sys.argv[1:]),
        "recording": str(source.path.resolve()),
        "name": f"{recording.resolve().name}, live",
        "inputs": inputs.outright,
        **({"odometry": inputs.odom} if inputs.odom else {}),
        "camera": absolute(camera_asked(asked)),
        "T_base_camera": mounting_of(asked) or _mounting_by_tf(source, inputs),
        **setting(source, inputs, model_of(asked)),
    }


def calibrated(asked: DemoOptions) -> DemoOptions:
    """The options for a simulated room: the settings that hold in simulation, unless others are given."""
    if asked.params_file is not None:
        return asked
    changed = {change.partition("=")[0] for change in asked.changes} | ({"detector.model"} if asked.model else set())
    known = (f"{name}={value}" for name, value in SIMULATED.items() if name not in changed)
    return replace(asked, changes=(*known, *asked.changes))


def _inputs(recording: Path, asked: DemoOptions) -> Inputs:
    settings = read_settings(asked.params_file, asked.changes)
    print_ignored(settings)
    depth_source = settings.of("segmenter", SegmenterNodeParams).source
    remaps = parse_remaps(asked.remaps)
    with open_recording(recording) as opened:
        source = with_transforms(with_camera(opened, camera_asked(asked), remaps, depth_source))
        for note in source.notes:
            _say(f"! {note}")
        inputs = choose_inputs(source.topics, remaps, depth_source, first_frames(source))
        if inputs.complete:
            return inputs
        wanted = inputs.wanted(depth_source)
        other = "" if depth_source == "auto" else ", or leave out segmenter.source"
        choose = f"{FOLDER}{other}" if source.of_pictures else f"see --remap{other}"
        raise ValueError(f"{recording}: expected {wanted}, got {', '.join(source.topics)}; {choose}")


def _say(text: str) -> None:
    click.echo(text, err=True)


def setup_of(asked: DemoOptions, inputs: Inputs, camera: str = "") -> Setup:
    """The arguments of the nodes and of the player, which plays just these inputs, with the ``camera`` if given."""
    everywhere = [] if asked.params_file is None else ["--params-file", str(asked.params_file)]
    node_args = {node: list(everywhere) for node in STAGES}
    named = {"model": asked.model, "labels": asked.labels}
    changes = [f"{node}.reliable=true" for node in STAGES if asked.lossless]
    changes += [*(f"detector.{name}={value}" for name, value in named.items() if value), *asked.changes]
    for node, name, value in map(parse_change, changes):
        if node not in STAGES:
            raise ValueError(f"--set: expected a node of the demo ({', '.join(STAGES)}), got {node}; leave it out")
        node_args[node] += _override(node, ros_argument(name, value))
    replay = ["--lossless"] if asked.lossless else ["--rate", str(asked.rate)]
    replay += ["--camera", camera] if camera else []
    replay += [] if asked.seconds is None else ["--end", str(asked.seconds)]
    remaps = [f"{name}:={topic}" for name, topic in inputs.outright.items()]
    return Setup(node_args, [*replay, *(argument for remap in remaps for argument in ("--remap", remap))])


def _override(node: str, argument: str) -> list[str]:
    """The arguments that set a parameter of a node over its file, for all nodes (``/**``) or for this one.

    In ROS the name whose first use comes last takes precedence, so the value is set for all nodes and for this one.
    """
    return ["-p", argument, "-p", f"{node}:{argument}"]


def _sent(source: Recording, inputs: Inputs, seconds: float | None, live: Live) -> dict[str, int]:
    """How many frames were sent to each node."""
    depth = inputs.depth or inputs.points
    end_ns = None if seconds is None else source.start_ns + round(seconds * 1e9)
    counts = Counter(record.topic for record in source.records({inputs.image or "", depth or ""}, end_ns=end_ns))
    return {
        "detector": counts[inputs.image or ""],
        "segmenter": counts[depth or ""],
        "registrar": live.counters["segmenter"].published,
    }


def mounting_of(asked: DemoOptions) -> tuple[float, ...]:
    """The registrar's ``T_base_camera``: x y z qx qy qz qw, or nothing."""
    return read_settings(asked.params_file, asked.changes).of("registrar", RegistrarNodeParams).T_base_camera


def _mounting_by_tf(source: Recording, inputs: Inputs) -> tuple[float, ...]:
    """The same by the recording's /tf_static, where the nodes receive it."""
    from objreg_ros.bridge.streams.player import is_installed

    T = camera_on_body(source, inputs)[2] if is_installed(TRANSFORMS) else None
    return () if T is None else (*T[:3, 3].tolist(), *map(float, quaternion_from_rotation(T[:3, :3])))


def camera_asked(asked: DemoOptions) -> str:
    """The camera that is given, by its option or by the segmenter's parameter; empty where none is."""
    by_parameter = read_settings(asked.params_file, asked.changes).of("segmenter", SegmenterNodeParams).camera
    return asked.camera or by_parameter


def model_of(asked: DemoOptions) -> str:
    """The detector's model, by its option or by its parameter."""
    return asked.model or read_settings(asked.params_file, asked.changes).of("detector", DetectorParams).model


def summary_of(status: Mapping[str, Any], live: Live, truth: Truth) -> dict[str, Any]:
    """The run as JSON, after the fields on its recording."""
    return {
        **status,
        "nodes": {node: asdict(counters) for node, counters in live.counters.items()},
        "constraints": [constraint_with_error(closure, truth) for closure in live.closures],
        "rejected": dict(live.rejected),
        "truth": summarise(truth.errors(live.closures)),
        "refusals": [fields_of(rejected) for rejected in live.refusals],
        "glimpses": live.glimpses,
    }


def _draw(out: Path, live: Live, truth: Truth, source: Recording, inputs: Inputs) -> None:
    if truth.poses:
        try:
            draw_trajectory(out / "trajectory.png", truth, live.closures)
            _say(f"drew {out / 'trajectory.png'}")
        except ModuleNotFoundError as absent:  # an extra that a robot does without
            _say(f"did not draw {out / 'trajectory.png'}: {absent}")
    image = None if live.sight is None else _image(source, inputs, live.sight.detections.stamp_ns)
    camera = camera_of(source, inputs)
    if live.sight is not None and image is not None and camera is not None:
        draw_sight(out / "detections.png", image.rgb, camera, live.sight.detections, live.sight.objects)
        _say(f"drew {out / 'detections.png'}")


def camera_of(source: Recording, inputs: Inputs) -> Intrinsics | None:
    """The camera of a recording by its camera_info; None where it has none, or one that is not calibrated."""
    info = None if inputs.camera_info is None else next(iter(source.records([inputs.camera_info]))).message
    return camera_from_msg.intrinsics(info) if info is not None and camera_from_msg.is_calibrated(info) else None


def _image(source: Recording, inputs: Inputs, stamp_ns: int) -> ColourImage | None:
    """The colour image with one stamp."""
    messages = (record.read() for record in source.records([inputs.image or ""]))
    found = next(
        (message for message in messages if message is not None and headers.stamp_ns(message) == stamp_ns), None
    )
    return None if found is None else from_msg.image(found)
