# SPDX-License-Identifier: Apache-2.0
"""`objreg offline`: a recording through the three rooms without ROS."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from objreg_ros.bridge.calibration import absolute
from objreg_ros.cli import FIRST_TIME, options
from objreg_ros.cli.options import require_writable
from objreg_ros.cli.outputs import Outputs
from objreg_ros.cli.settings import Settings, read_settings, tell_ignored
from objreg_ros.cli.told import STANDARD_OUTPUT, exit_code, json_to, tell, tell_next, tell_reasons, tell_run
from objreg_ros.detector.params import DetectorParams
from objreg_ros.offline import Run, Timing, build_rooms, run_offline
from objreg_ros.recording import Record, Recording, open_recording
from objreg_ros.recording.drift import ODOM, with_drifting_odometry
from objreg_ros.recording.inputs import Inputs, choose_inputs, parse_remaps
from objreg_ros.recording.mounts import static_frames
from objreg_ros.recording.told_camera import with_camera
from objreg_ros.recording.troubles import troubles
from objreg_ros.registration.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.report.about import about
from objreg_ros.report.findings import as_json, find, setting, verdict
from objreg_ros.report.map_files import VOXEL_M
from objreg_ros.report.pictures import Album
from objreg_ros.report.story import Story
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_ros.truth import Truth

FILE = click.Path(dir_okay=False, path_type=Path)
DRIFT = "drift:"
CAMERAS_OWN = (
    "--odometry {} is the camera's own and not level: T_base_camera and segmenter.level_odom are left out of this run"
)


@click.command()
@options.recording
@options.model
@options.labels
@options.camera
@options.json_out
@click.option(
    "--tum", type=FILE, help="Write the corrected trajectory here: stamp tx ty tz qx qy qz qw, as evo reads it."
)
@click.option("--kitti", type=FILE, help="Write it here as 12 numbers a pose, of the 3x4 matrix. KITTI has no stamps.")
@click.option("--g2o", type=FILE, help="Write the corrected pose graph here, without the constraints that were pruned.")
@click.option("--map", "cloud", type=FILE, metavar="FILE.ply", help="Write here what the keyframes saw, corrected.")
@click.option(
    "--voxel",
    type=float,
    default=VOXEL_M,
    show_default=True,
    help="The side of the voxels to which --map is thinned, m. It doubles where they do not fit into memory.",
)
@options.scene_files
@click.option("--max-frames", type=click.IntRange(min=1), help="Stop after this many frames.")
@click.option(
    "--odometry",
    metavar="TOPIC|none|drift:SEED",
    help="Another topic, no odometry, or a synthetic one that drifts away from the recording's ground truth.",
)
@options.params
@options.change
@options.remap
def command(
    recording: Path,
    model: str | None,
    labels: str | None,
    camera: str,
    json_file: Path | None,
    max_frames: int | None,
    odometry: str | None,
    params_file: Path | None,
    changes: tuple[str, ...],
    remaps: tuple[str, ...],
    **files: Any,
) -> int:
    """Run RECORDING (rosbag1, rosbag2 or a TUM RGB-D folder) through detector, segmenter and registrar without ROS.

    Deterministic, and as fast as the CPU goes. Prints what came out and, where the recording has ground truth, the
    true error of every constraint.

    With odometry the constraints correct it: --tum, --kitti, --g2o and --map write what comes out, in the frame in
    which odometry began. Poses are of the camera's optical frame, at every frame of the recording.

    Says where the run stopped if no loop was closed, and ends with 3 if no frame got through.
    """
    outputs = Outputs.of(**files)
    if json_file is not None:
        require_writable("--json", json_file)
    _require_seed(odometry)
    settings = read_settings(params_file, [*changes, *_named(model, labels, camera)])
    tell_ignored(settings)
    told = settings.of("segmenter", SegmenterNodeParams)
    with open_recording(recording) as opened, TemporaryDirectory() as folder, json_to(json_file) as write_json:
        source = with_camera(opened, told.camera, parse_remaps(remaps), told.source)
        inputs = _inputs(source, remaps, odometry, told.source)
        truth = Truth.of(source, inputs.ground_truth)
        outputs.require_way(source, inputs, bool(truth.poses))
        for note in (*source.notes, *truth.notes):
            click.echo(f"! {note}", err=True)
        registrar = outputs.remembering(settings.of("registrar", RegistrarParams), folder)
        run = _run(source, inputs, settings, registrar, max_frames, odometry)
        detector = settings.of("detector", DetectorParams)
        summary = {
            "about": about(recording, detector.model, settings.changed(), sys.argv[1:]),
            "recording": str(recording.resolve()),
            "inputs": inputs.outright,
            "odometry": inputs.odom,
            "rectified": told.rectified,
            "camera": absolute(told.camera),
            **setting(source, inputs, detector.model),
            **run.summary(truth),
        }
        tell_run(run, summary)
        tell_reasons(run.refusals)
        findings = find(summary, troubles(source, inputs))
        click.echo(verdict(summary, findings))
        tell(findings)
        write_json({**summary, "findings": as_json(findings)})
        if outputs.wanted:
            story = Story.of(recording.name, summary, truth)
            outputs.write(story, Album(source, inputs, told.rectified), Path(registrar.store))
        if run.closures:
            _say_what_follows(recording, json_file)
        return exit_code(summary)


def _say_what_follows(recording: Path, json_file: Path | None) -> None:
    """How one looks at the closed loops, unless this run is part of that already."""
    asked = click.get_current_context().find_root().invoked_subcommand
    if asked != "report" and json_file != STANDARD_OUTPUT:
        tell_next("objreg", "report", str(json_file or recording))


def _require_seed(odometry: str | None) -> None:
    """ValueError for a drift that does not say its seed."""
    is_drift = odometry is not None and (odometry + ":").startswith(DRIFT)
    if is_drift and not str(odometry).removeprefix(DRIFT).isdecimal():
        raise ValueError(f"--odometry: expected drift: and a seed like drift:1, got {odometry!r}")


def _drifts(odometry: str | None) -> bool:
    return (odometry or "").startswith(DRIFT)


def _named(model: str | None, labels: str | None, camera: str) -> list[str]:
    named = {"detector.model": model, "detector.labels": labels, "segmenter.camera": camera}
    return [f"{name}={value}" for name, value in named.items() if value]


def _inputs(source: Recording, remaps: tuple[str, ...], odometry: str | None, depth_source: str) -> Inputs:
    asked = parse_remaps(remaps)
    if odometry is not None:
        asked["odom"] = "" if odometry == "none" or _drifts(odometry) else odometry
        if asked["odom"] and asked["odom"] not in source.topics:
            there = ", ".join(source.topics)
            raise ValueError(f"--odometry: expected a topic of {there}, or none, or drift:SEED, got {odometry!r}")
    inputs = choose_inputs(source.topics, asked, depth_source)
    if not inputs.complete:
        there = ", ".join(f"{topic.name} ({topic.msgtype})" for topic in source.topics.values()) or "no topics"
        wanted = inputs.wanted(depth_source)
        other = "" if depth_source == "auto" else ", or leave out segmenter.source"
        raise ValueError(f"{source.path}: expected {wanted}, got {there}; choose with --remap input:=/topic{other}")
    if _drifts(odometry):
        if inputs.ground_truth is None:
            raise ValueError(f"{source.path}: --odometry {odometry} needs a ground truth, and there is none")
        return Inputs(**{**inputs.chosen(), "odom": ODOM})
    return inputs


def _run(
    source: Recording,
    inputs: Inputs,
    settings: Settings,
    registrar: RegistrarParams,
    max_frames: int | None,
    odometry: str | None,
) -> Run:
    max_rate = settings.of("detector", DetectorParams).max_rate
    find_pose = static_frames(source).between
    timing = replace(_timing(settings, odometry), find_pose=find_pose, max_rate=max_rate)
    click.echo(f"preparing the rooms ({FIRST_TIME})", err=True)
    rooms, close = build_rooms(
        settings.of("detector", DetectorParams),
        settings.of("segmenter", SegmenterParams),
        registrar,
    )
    try:
        frames = source.topics[inputs.depth or inputs.points or ""].count
        with tqdm(total=min(frames, max_frames or frames), unit="frame", disable=None, leave=False) as bar:
            records = _records(source, inputs, odometry)
            return run_offline(records, rooms, inputs, timing, max_frames, lambda count: bar.update(count - bar.n))
    finally:
        close()


def _timing(settings: Settings, odometry: str | None) -> Timing:
    segmenter, registrar = settings.of("segmenter", SegmenterNodeParams), settings.of("registrar", RegistrarNodeParams)
    slop_ns, odom_slop_ns = round(segmenter.slop * 1e9), round(registrar.odom_slop * 1e9)
    if _drifts(odometry):
        if registrar.mounting is not None or segmenter.level_odom:
            click.echo(f"! {CAMERAS_OWN.format(odometry)}", err=True)
        imu = segmenter.imu_mounting
        here, colour, rectified = np.eye(4), segmenter.colour, segmenter.rectified
        return Timing(slop_ns, odom_slop_ns, here, colour, rectified=rectified, T_camera_imu=imu)
    return Timing(
        slop_ns=slop_ns,
        odom_slop_ns=odom_slop_ns,
        T_base_camera=registrar.mounting,
        colour=segmenter.colour,
        level_odom=segmenter.level_odom,
        T_level_camera=segmenter.mounting,
        rectified=segmenter.rectified,
        T_camera_imu=segmenter.imu_mounting,
    )


def _records(source: Recording, inputs: Inputs, odometry: str | None) -> Iterator[Record]:
    records = source.records(set(inputs.chosen().values()))
    if odometry is None or not _drifts(odometry) or inputs.ground_truth is None:
        return records
    return with_drifting_odometry(records, inputs.ground_truth, int(odometry.removeprefix(DRIFT)))
