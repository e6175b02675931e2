# SPDX-License-Identifier: Apache-2.0
"""`objreg offline`: a recording through detector, segmenter and registrar without ROS."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
from tqdm import tqdm

from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.cli import options
from objreg_tools.cli.outputs import Outputs
from objreg_tools.cli.paths import STANDARD_OUTPUT, GraphPath, OutputPath
from objreg_tools.cli.recorded import Opened, RecordedOptions
from objreg_tools.cli.run_output import (
    exit_code,
    json_to,
    notify,
    print_next,
    print_reasons,
    print_run,
    print_trajectory,
)
from objreg_tools.cli.settings import print_ignored
from objreg_tools.offline.run import Run
from objreg_tools.recording.troubles import troubles
from objreg_tools.report.exports.voxel_cloud import VOXEL_M
from objreg_tools.report.pair.pair_command import OF_RUN, passed_on
from objreg_tools.report.run.findings import as_json, find, verdict
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_summary import RunSummary

FILE = OutputPath(dir_okay=False, path_type=Path)


@click.command()
@options.recording
@options.json_out
@click.option(
    "--tum", type=FILE, help="Write the corrected trajectory here: stamp tx ty tz qx qy qz qw, as evo reads it."
)
@click.option("--tum-before", type=FILE, help="Likewise as it was before constraints corrected it.")
@click.option("--tum-truth", type=FILE, help="Likewise the ground truth of the recording, at the same stamps.")
@click.option("--kitti", type=FILE, help="Write it here as 12 numbers a pose, of the 3x4 matrix. KITTI has no stamps.")
@click.option(
    "--g2o",
    type=GraphPath(dir_okay=False, path_type=Path),
    help="Write the corrected pose graph here, without the constraints that were pruned, and the times of its vertices "
    "beside it, as FILE.times.csv.",
)
@options.of_grid
@click.option(
    "--map",
    "cloud",
    type=OutputPath(path_type=Path),
    metavar="FOLDER|FILE.ply",
    help="Write the corrected map into this folder: map.pgm with map.yaml, a grid as Nav2's map_server reads it, the "
    "cloud map.ply, and the objects with their covariances, landmarks.json. A name with an ending is a file, "
    "into which the cloud alone is written.",
)
@click.option(
    "--voxel",
    type=float,
    default=VOXEL_M,
    show_default=True,
    help="The side of the voxels to which --map is thinned, m. It doubles where they do not fit into memory.",
)
@options.scene_files
@options.of_run
def command(recording: Path, json_file: Path | None, **given: Any) -> int:
    """Run RECORDING (rosbag1, rosbag2 or a TUM RGB-D folder) through detector, segmenter and registrar without ROS.

    Deterministic, and as fast as the CPU goes. Prints what came out and, where the recording has ground truth, the
    true error of every constraint.

    The constraints correct the odometry, or without one the registrar's own tracking: --tum, --kitti, --g2o and --map
    write what comes out, in the frame in which it began. Poses are of the camera's optical frame, at every frame. Where
    the track is lost, they are those of the largest part that constraints tie together.

    Reports where the run stopped if no loop was closed. Ends with 3 if no frame got through.
    """
    asked = RecordedOptions.of(**{name: given.pop(name) for name in options.OF_RUN})
    outputs = Outputs.of(**given)
    print_ignored(asked.settings)
    with asked.opened(recording) as opened, TemporaryDirectory() as folder, json_to(json_file) as write_json:
        outputs.require_trajectory(opened.source, opened.odometry is not None, bool(opened.truth.poses))
        for note in opened.notes:
            click.echo(f"! {note}", err=True)
        registrar = outputs.remembering(asked.settings.of("registrar", RegistrarParams), folder)
        run = _run(opened, registrar)
        summary = opened.summary(run, sys.argv[1:])
        print_run(run, summary)
        print_reasons(run.refusals)
        findings = find(summary, troubles(opened.source, opened.inputs))
        run_summary = RunSummary.of(recording.name, summary, opened.truth)
        trajectory = run_summary.trajectory()
        click.echo(verdict(summary, findings, run_summary.closed_revisits, trajectory))
        notify(findings)
        print_trajectory(trajectory)
        write_json({**summary, "trajectory": trajectory, "findings": as_json(findings)})
        if outputs.wanted:
            outputs.write(run_summary, Album(opened.source, opened.inputs, summary["rectified"]), Path(registrar.store))
        if run.closures:
            _say_what_follows(recording, json_file)
        return exit_code(summary)


def _run(opened: Opened, registrar: RegistrarParams) -> Run:
    click.echo("preparing detector, segmenter and registrar", err=True)
    with tqdm(total=opened.frames, unit="frame", disable=None, leave=False) as bar:
        return opened.run(registrar, lambda count: bar.update(count - bar.n))


def _say_what_follows(recording: Path, json_file: Path | None) -> None:
    """The command that shows the closed loops, unless this run is part of that already."""
    asked = click.get_current_context().find_root().invoked_subcommand
    if asked != "report" and json_file != STANDARD_OUTPUT:
        again = [str(json_file)] if json_file else [str(recording), *passed_on(sys.argv[1:], OF_RUN)]
        print_next("objreg", "report", *again)
