# SPDX-License-Identifier: Apache-2.0
"""A run as a recording for the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np

from objreg_ros import extra
from objreg_ros.whole_file import folder_for, put_whole
from objreg_tools.report.exports.run_scene import ClosureEdge, RunScene, SceneFrame

COLOURS = {
    "odometry": (217, 89, 38),
    "tracked": (217, 89, 38),
    "corrected": (42, 120, 214),
    "true": (139, 138, 131),
    "accepted": (26, 138, 60),
    "false": (208, 59, 59),
    "pruned": (168, 113, 10),
}
THICK_M, THIN_M, BALL_M = 0.008, 0.004, 0.03
QUALITY = 80  # of a JPEG


def require_rerun() -> ModuleType:
    """The SDK; ValueError that names the extra where it is not installed."""
    return extra.load("rerun", "rerun", "--rerun")


def write_rerun(file: Path, scene: RunScene) -> int:
    """Write a scene as an .rrd file; returns how many frames with picture and cloud it has.

    ``map/`` holds ``trajectories``, ``closures`` by verdict and ``objects``, which stay. The timeline ``time`` holds
    the ``camera`` with its image and its ``cloud``. ValueError without the SDK, OSError where the
    file cannot be written; then it leaves no file.
    """
    rr = require_rerun()
    with folder_for(file) as folder:
        recording = rr.RecordingStream("objreg", recording_id=f"objreg {scene.name}")
        recording.save(folder / "run.rrd")
        _log_trajectories(rr, recording, scene)
        _log_closures(rr, recording, scene.edges)
        _log_objects(rr, recording, scene)
        count = 0
        for count, moment in enumerate(scene.moments(), start=1):  # noqa: B007
            _log_moment(rr, recording, moment)
        recording.disconnect()
        put_whole(folder / "run.rrd", file)
    return count


def _log_trajectories(rr: ModuleType, recording: Any, scene: RunScene) -> None:
    for name, trajectory in scene.trajectories.items():
        lines = rr.LineStrips3D([trajectory.positions], colors=[COLOURS[name]], radii=[THICK_M], labels=[name])
        recording.log(f"map/trajectories/{name}", lines, static=True)


def _log_closures(rr: ModuleType, recording: Any, edges: tuple[ClosureEdge, ...]) -> None:
    """A line for each closure; its labels and its true error show when the pointer is over it."""
    for verdict in dict.fromkeys(edge.verdict for edge in edges):
        of = [edge for edge in edges if edge.verdict == verdict]
        lines = rr.LineStrips3D(
            [edge.ends for edge in of],
            colors=[COLOURS[verdict]] * len(of),
            radii=[THIN_M] * len(of),
            labels=[edge.text for edge in of],
            show_labels=False,
        )
        recording.log(f"map/closures/{verdict}", lines, static=True)


def _log_objects(rr: ModuleType, recording: Any, scene: RunScene) -> None:
    """The objects of each label; every label has the colour that Rerun gives its number."""
    for number, label in enumerate(sorted({label for label, _ in scene.objects})):
        places = np.array([xyz for name, xyz in scene.objects if name == label])
        points = rr.Points3D(
            places,
            radii=[BALL_M],
            labels=[label] * len(places),
            show_labels=False,
            class_ids=[number + 1] * len(places),
        )
        recording.log(["map", "objects", label], points, static=True)


def _log_moment(rr: ModuleType, recording: Any, moment: SceneFrame) -> None:
    recording.set_time("time", timestamp=np.datetime64(moment.stamp_ns, "ns"))
    T, camera = moment.T_map_camera, moment.camera
    recording.log("map/camera", rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))
    lens = rr.Pinhole(
        focal_length=(camera.fx, camera.fy),
        principal_point=(camera.cx, camera.cy),
        width=camera.width,
        height=camera.height,
        image_plane_distance=0.2,
    )
    recording.log("map/camera/image", lens)
    _, jpeg = cv2.imencode(".jpg", moment.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    recording.log("map/camera/image", rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))
    recording.log("map/camera/cloud", rr.Points3D(moment.xyz, colors=moment.colours))
