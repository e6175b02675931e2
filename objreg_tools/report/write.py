# SPDX-License-Identifier: Apache-2.0
"""From the JSON of runs to the page."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import mounting
from objreg_ros.whole_file import write_whole
from objreg_tools.recording import Recording
from objreg_tools.recording.camera_from_text import with_camera
from objreg_tools.recording.folders.text import read_text
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.opening import open_recording
from objreg_tools.recording.poses import pose_of
from objreg_tools.recording.tf_odometry import with_transforms
from objreg_tools.report.page import page
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_schema import require_form
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.stage_times import in_order
from objreg_tools.truth import Truth

ODOMETRY_SLOP_NS = 20_000_000  # as the registrar's default


def write_report(
    out: Path, runs: Sequence[Path], compared_last: bool = False, on_picture: Callable[[], None] = lambda: None
) -> list[str]:
    """Write one page about runs from the files of `objreg offline --json`, or of `objreg demo`.

    Several runs are compared before them; with ``compared_last`` after them.

    The recording that a run names gives truth and pictures. Where it is gone, the page does without; the result has one
    line for each such run. ``on_picture`` is called whenever a picture was read. ValueError for a file that is no run.
    """
    with ExitStack() as stack:
        loaded = [_loaded(file, stack, on_picture) for file in runs]
        text = page(loaded, compared_last)
    write_whole(out, text)
    lacking = [file for file, (_, album) in zip(runs, loaded, strict=True) if album is None]
    return [
        f"{file} names a recording that is not there: the page shows neither truth nor pictures" for file in lacking
    ]


def _loaded(file: Path, stack: ExitStack, on_picture: Callable[[], None]) -> tuple[RunSummary, Album | None]:
    summary = _read(file)
    place = Path(summary.get("recording", ""))
    if not summary.get("recording") or not place.exists():
        return RunSummary.of(file.stem, summary, Truth([])), None
    opened = with_transforms(stack.enter_context(open_recording(place)))
    recording = with_camera(opened, summary.get("camera", ""), _inputs_of(summary, opened))
    inputs = choose_inputs(recording.topics, _inputs_of(summary, recording))
    T_base_camera = mounting(summary.get("T_base_camera", ()))
    glimpses = with_odometry(summary.get("glimpses", ()), recording, inputs.odom, T_base_camera)
    complete = {**_of_nodes(summary), **summary, "glimpses": glimpses}
    run = RunSummary.of(summary.get("name", place.resolve().name), complete, Truth.of(recording, inputs.ground_truth))
    return run, Album(recording, inputs, summary.get("rectified", "auto"), on_picture)


def _inputs_of(summary: Mapping[str, Any], recording: Recording) -> dict[str, str]:
    """The inputs that the run took, as remaps; none where an older JSON lacks them.

    A topic that the recording lacks was made for the run, like an odometry that drifts: there is nothing to read.
    """
    inputs = summary.get("inputs", {})
    return {name: topic if topic in recording.topics else "" for name, topic in inputs.items()}


def with_odometry(
    glimpses: Sequence[Mapping[str, Any]], recording: Recording, topic: str | None, T_base_camera: Array | None
) -> list[Mapping[str, Any]]:
    """The frames of a run; those without a pose get the camera's pose by the recording's odometry.

    The odometry is of the body that carries the camera at ``T_base_camera``; None where the two are one. Without any
    frame, the odometry alone.
    """
    if any("T_odom_camera" in row for row in glimpses):
        return list(glimpses)
    odometry = [pose_of(record) for record in (recording.records([topic]) if topic else ())]
    T_body_camera = np.eye(4) if T_base_camera is None else T_base_camera
    poses = {pose.stamp_ns: (pose.T_odom_body @ T_body_camera).tolist() for pose in odometry if pose is not None}
    rows = glimpses or [{"stamp_ns": stamp} for stamp in sorted(poses)]
    stamps = np.array(sorted(poses), np.int64)
    return [{**row, "T_odom_camera": poses.get(_nearest(stamps, row["stamp_ns"]))} for row in rows]


def _nearest(stamps: Array, stamp_ns: int) -> int:
    """The stamp within `ODOMETRY_SLOP_NS`; -1 if there is none."""
    if len(stamps) == 0:
        return -1
    nearest = int(stamps[np.abs(stamps - stamp_ns).argmin()])
    return nearest if abs(nearest - stamp_ns) <= ODOMETRY_SLOP_NS else -1


def _of_nodes(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The counters of live nodes: how many frames, and how long each stage took."""
    nodes = summary.get("nodes", {})
    stages = {
        f"{node}{part}: {stage}": {"p50": p50, "p95": p95}
        for node, counters in nodes.items()
        for part, stage, (p50, p95) in in_order(counters["stage_ms"])
    }
    return {"frames": nodes["segmenter"]["published"], "stage_ms": stages} if "segmenter" in nodes else {}


def _read(file: Path) -> Mapping[str, Any]:
    try:
        summary = json.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: expected the JSON of `objreg offline --json`, got: {error}") from error
    if not isinstance(summary, dict) or "constraints" not in summary:
        raise ValueError(f"{file}: expected the JSON of `objreg offline --json`, got JSON without constraints")
    require_form(str(file), summary)
    return summary
