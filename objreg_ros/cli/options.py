# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import click

from objreg_ros.recording.inputs import GRAPH_TOPICS
from objreg_ros.whole_file import resolved

recording = click.argument("recording", type=click.Path(path_type=Path))
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
    type=click.Path(path_type=Path),
    help="ROS 2 parameter file, like config/objreg.yaml.",
)
change = click.option("--set", "changes", multiple=True, metavar="NODE.NAME=VALUE", help="Change one parameter.")
camera = click.option(
    "--camera",
    default="",
    metavar="FX,FY,CX,CY[,W,H]|FILE",
    help="The camera in place of camera_info: pixels, or a file of ROS, OpenCV, RTAB-Map, ORB-SLAM, kalibr or Open3D.",
)
model = click.option("--model", help="ONNX model: a path or the name of an installed one.")
json_out = click.option(
    "--json",
    "json_file",
    type=click.Path(dir_okay=False, allow_dash=True, path_type=Path),
    help="Write the outcome here; - is standard output, and all else then goes to standard error.",
)
labels = click.option("--labels", help="Text file of labels, one a line, or YAML with names:.")

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


def scene_files(command: Callable) -> Callable:
    """The files of a run for viewers, ``rerun`` and ``mcap``."""
    file = click.Path(dir_okay=False, path_type=Path)
    mcap = click.option("--mcap", type=file, metavar="FILE.mcap", help="Write the run here for Foxglove.")
    rerun = click.option("--rerun", type=file, metavar="FILE.rrd", help="Write the run here for the Rerun viewer.")
    return rerun(mcap(command))


def require_writable(option: str, file: Path) -> None:
    """OSError before the work rather than after it, where the ``file`` of an option could not be written."""
    if str(file) == "-":  # standard output
        return
    if not file.parent.is_dir():
        raise OSError(f"{option}: expected an existing folder {file.parent}, got none; create it or choose another")
    if not all(os.access(place, os.W_OK) for place in _places(file)):
        raise OSError(f"{option}: expected permission to write {file}, got none; choose another place")
    try:
        _try_to_write(file)
    except OSError as error:
        why = error.strerror or error
        raise OSError(f"{option}: expected a place that takes a file, got at {file}: {why}; choose another") from error


def _places(file: Path) -> list[Path]:
    """What has to be writable: a new file lies in the folder before it takes the place of an old one."""
    if not file.exists():
        return [file.parent]
    return [file, resolved(file).parent] if file.is_file() else [file]


def _try_to_write(file: Path) -> None:
    """OSError where a file can be neither made nor opened for writing, whatever its permissions say; leaves no trace.

    What is no plain file, as a pipe, is not opened: that would wait for its reader.
    """
    if file.exists() and not file.is_file():
        return
    with tempfile.TemporaryFile(dir=resolved(file).parent):
        pass
    if file.exists():
        with file.open("ab"):
            pass
