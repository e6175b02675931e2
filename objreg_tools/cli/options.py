# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from objreg_tools.cli.paths import InputText, ModelText, OutputPath, RecordingPath, SettingsPath
from objreg_tools.recording.inputs import GRAPH_TOPICS
from objreg_tools.report.exports.occupancy_grid import BAND_M, CELL_M

recording = click.argument("recording", type=RecordingPath(path_type=Path))
remap = click.option(
    "--remap",
    "remaps",
    multiple=True,
    metavar="INPUT:=TOPIC",
    help=f"Take an input from this topic, or from none. Inputs: {', '.join(GRAPH_TOPICS)}.",
)
params = click.option(
    "--params",
    "params_file",
    type=SettingsPath(path_type=Path),
    help="ROS 2 parameter file, like config/objreg.yaml.",
)
change = click.option(
    "--set", "changes", type=InputText(), multiple=True, metavar="NODE.NAME=VALUE", help="Change one parameter."
)
camera = click.option(
    "--camera",
    type=InputText(),
    default="",
    metavar="FX,FY,CX,CY[,W,H]|FILE",
    help="The camera in place of camera_info: pixels, or a file of ROS, OpenCV, RTAB-Map, ORB-SLAM, kalibr or Open3D.",
)
model = click.option("--model", type=ModelText(), help="ONNX model: a path or the name of an installed one.")
json_out = click.option(
    "--json",
    "json_file",
    type=OutputPath(dir_okay=False, allow_dash=True, path_type=Path),
    help="Write the outcome here; - is standard output, and all else then goes to standard error.",
)
labels = click.option("--labels", type=InputText(), help="Text file of labels, one a line, or YAML with names:.")

max_frames = click.option("--max-frames", type=click.IntRange(min=1), help="Stop after this many frames.")
odometry = click.option(
    "--odometry",
    metavar="TOPIC|tf|tracked|none|drift:SEED",
    help="Another topic (of Odometry or poses); the moving frame on /tf; the registrar's own tracking (as where there "
    "is no odometry); no trajectory; or a synthetic one that drifts away from the recording's ground truth.",
)
detections = click.option(
    "--detections",
    metavar="TOPIC",
    help="Boxes (vision_msgs/Detection2DArray) or masks that the recording holds, in place of the detector.",
)
OF_RUN = ("model", "labels", "camera", "max_frames", "odometry", "params_file", "changes", "remaps", "detections")


def of_run(command: Callable) -> Callable:
    """How a recording is run, in `OF_RUN`."""
    for option in (remap, change, params, odometry, max_frames, camera, labels, detections, model):
        command = option(command)
    return command


ONE_THREAD = ("registrar.threads=1", "detector.threads=1")  # of a run beside which others run


def over_workers(command: Callable) -> Callable:
    """Many ``recordings``, where their results go (``out``), and who runs them: ``workers``, or a ``scheduler``'s."""
    recording = RecordingPath(path_type=Path, resolve_path=True)
    recordings = click.argument("recordings", nargs=-1, required=True, type=recording, metavar="RECORDINGS…")
    out = click.option(
        "--out",
        required=True,
        type=OutputPath(file_okay=False, path_type=Path, resolve_path=True),
        help="The folder of the results; all workers have to see it, and the recordings, at the same path.",
    )
    here, cluster = (
        "Processes of this machine; one for each core by default.",
        "A Dask cluster in place of this machine.",
    )
    workers = click.option("--workers", type=click.IntRange(min=1), help=here)
    scheduler = click.option("--scheduler", default="", metavar="tcp://HOST:PORT", help=cluster)
    return recordings(out(workers(scheduler(command))))


def require_one_place(workers: int | None, scheduler: str) -> None:
    """UsageError where runs are to be on this machine and on a cluster."""
    if scheduler and workers is not None:
        raise click.UsageError("expected --workers or --scheduler, got both; a cluster has the workers that it has")


def scene_files(command: Callable) -> Callable:
    """The files of a run for viewers, ``rerun`` and ``mcap``."""
    file = OutputPath(dir_okay=False, path_type=Path)
    mcap = click.option("--mcap", type=file, metavar="FILE.mcap", help="Write the run here for Foxglove.")
    rerun = click.option("--rerun", type=file, metavar="FILE.rrd", help="Write the run here for the Rerun viewer.")
    return rerun(mcap(command))


def of_grid(command: Callable) -> Callable:
    """How the grid of a map is made: ``cell`` and ``band``."""
    cell = click.option(
        "--cell", type=float, default=CELL_M, show_default=True, help="The side of a cell of the grid of --map, m."
    )
    band = click.option(
        "--band",
        type=(float, float),
        default=BAND_M,
        show_default=True,
        metavar="LOW HIGH",
        help="The heights above the floor, m, between which something is in the way on the grid of --map.",
    )
    return cell(band(command))
