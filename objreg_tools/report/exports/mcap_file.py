# SPDX-License-Identifier: Apache-2.0
"""A run as one MCAP file of standard ROS 2 messages, as Foxglove opens it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.whole_file import folder_for, put_whole
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.rosbag.writer import write_rosbag2
from objreg_tools.report.exports.run_scene import ClosureEdge, RunScene, SceneFrame, ShownTrajectory

MAP, CAMERA = "map", "camera"  # frames
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
QUALITY = 80  # of a JPEG
SPHERE_LIST, LINE_LIST, TEXT = 7, 5, 9  # kinds of visualization_msgs/Marker
COLOURS = {"accepted": (0.1, 0.54, 0.24), "false": (0.82, 0.23, 0.23), "pruned": (0.66, 0.44, 0.04)}
OBJECTS, WHITE_TEXT = (1.0, 0.75, 0.1), (1.0, 1.0, 1.0)
LINE_M, BALL_M, TEXT_M = 0.01, 0.05, 0.05


def write_mcap(file: Path, scene: RunScene) -> int:
    """Write a scene as a single .mcap file; returns how many frames with picture and cloud it has.

    ``/trajectory/NAME`` (Path), ``/closures`` and ``/objects`` (MarkerArray) come at the first stamp and stay. ``/tf``
    moves the frame ``camera`` through the map, with ``/camera/image/compressed``, ``/camera/camera_info`` and
    ``/camera/points``. OSError where the file cannot be written; then it leaves no file.
    """
    with folder_for(file) as folder:
        bag = folder / "run"
        records = list(_records(scene))
        write_rosbag2(bag, sorted(records, key=lambda record: record.stamp_ns))
        put_whole(next(bag.glob("*.mcap")), file)
    return sum(record.topic == "/camera/points" for record in records)


def _records(scene: RunScene) -> Iterator[Record]:
    first_ns = min(trajectory.stamps_ns[0] for trajectory in scene.trajectories.values())
    for name, trajectory in scene.trajectories.items():
        yield Record.of(f"/trajectory/{name}", _path(trajectory, first_ns), first_ns)
    yield Record.of("/closures", _markers(_closures(scene.edges, first_ns)), first_ns)
    yield Record.of("/objects", _markers(_objects(scene.objects, first_ns)), first_ns)
    for stamp_ns, T_map_camera in zip(scene.main.stamps_ns, scene.main.poses, strict=True):
        yield Record.of("/tf", _transform(T_map_camera, stamp_ns), stamp_ns)
    for moment in scene.moments():
        yield from _seen(moment)


def _path(trajectory: ShownTrajectory, stamp_ns: int) -> Any:
    poses = [messages.pose_stamped(T, at, MAP) for at, T in zip(trajectory.stamps_ns, trajectory.poses, strict=True)]
    return messages.message("nav_msgs/Path", header=messages.header(stamp_ns, MAP), poses=poses)


def _transform(T_map_camera: Array, stamp_ns: int) -> Any:
    pose = messages.pose(T_map_camera)
    place = messages.message(
        "geometry_msgs/Vector3", **{name: getattr(pose.position, name) for name in ("x", "y", "z")}
    )
    stamped = messages.message(
        "geometry_msgs/TransformStamped",
        header=messages.header(stamp_ns, MAP),
        child_frame_id=CAMERA,
        transform=messages.message("geometry_msgs/Transform", translation=place, rotation=pose.orientation),
    )
    return messages.message("tf2_msgs/TFMessage", transforms=[stamped])


def _seen(moment: SceneFrame) -> Iterator[Record]:
    stamp_ns = moment.stamp_ns
    _, jpeg = cv2.imencode(".jpg", moment.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    head = messages.header(stamp_ns, CAMERA)
    image = messages.message("sensor_msgs/CompressedImage", header=head, format="jpeg", data=jpeg.reshape(-1))
    yield Record.of("/camera/image/compressed", image, stamp_ns)
    yield Record.of("/camera/camera_info", messages.camera_info(moment.camera, stamp_ns, CAMERA), stamp_ns)
    points = np.zeros((1, len(moment.xyz)), POINT)
    points["x"], points["y"], points["z"] = moment.xyz.T[:, None]
    r, g, b = moment.colours.T.astype(np.uint32)
    points["rgb"] = r << 16 | g << 8 | b
    yield Record.of("/camera/points", messages.point_cloud(points, stamp_ns, CAMERA), stamp_ns)


def _closures(edges: Sequence[ClosureEdge], stamp_ns: int) -> Iterator[Any]:
    """The lines of each verdict, and beside each line its labels and true error."""
    for verdict, colour in COLOURS.items():
        ends = [end for edge in edges if edge.verdict == verdict for end in edge.ends]
        if ends:
            yield _marker(verdict, 0, LINE_LIST, stamp_ns, colour, LINE_M, points=[_point(end) for end in ends])
    for number, edge in enumerate(edges):
        middle = edge.ends.mean(axis=0)
        yield _marker("words", number, TEXT, stamp_ns, WHITE_TEXT, TEXT_M, at=middle, text=edge.text)


def _objects(objects: Sequence[tuple[str, Array]], stamp_ns: int) -> Iterator[Any]:
    """The places of each label, with its name at the middle one."""
    for label in sorted({label for label, _ in objects}):
        places = np.array([xyz for name, xyz in objects if name == label])
        points = [_point(xyz) for xyz in places]
        yield _marker(label, 0, SPHERE_LIST, stamp_ns, OBJECTS, BALL_M, points=points)
        yield _marker(label, 1, TEXT, stamp_ns, WHITE_TEXT, TEXT_M, at=_most_central(places), text=label)


def _most_central(places: Array) -> Array:
    return np.asarray(places[np.linalg.norm(places - np.median(places, axis=0), axis=1).argmin()])


def _marker(
    space: str,
    number: int,
    kind: int,
    stamp_ns: int,
    colour: tuple[float, float, float],
    size: float,
    points: Sequence[Any] = (),
    at: Array | None = None,
    text: str = "",
) -> Any:
    place = np.eye(4)
    place[:3, 3] = 0.0 if at is None else at
    r, g, b = colour
    nowhere = messages.message("sensor_msgs/CompressedImage", header=messages.header(0, ""), format="",
                               data=np.zeros(0, np.uint8))  # fmt: skip
    return messages.message(
        "visualization_msgs/Marker",
        header=messages.header(stamp_ns, MAP),
        ns=space,
        id=number,
        type=kind,
        action=0,
        pose=messages.pose(place),
        scale=messages.message("geometry_msgs/Vector3", x=size, y=size, z=size),
        color=messages.message("std_msgs/ColorRGBA", r=r, g=g, b=b, a=1.0),
        lifetime=messages.message("builtin_interfaces/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=list(points),
        colors=[],
        texture_resource="",
        texture=nowhere,
        uv_coordinates=[],
        text=text,
        mesh_resource="",
        mesh_file=messages.message("visualization_msgs/MeshFile", filename="", data=np.zeros(0, np.uint8)),
        mesh_use_embedded_materials=False,
    )


def _point(xyz: Array) -> Any:
    x, y, z = (float(value) for value in xyz)
    return messages.message("geometry_msgs/Point", x=x, y=y, z=z)


def _markers(made: Iterator[Any]) -> Any:
    return messages.message("visualization_msgs/MarkerArray", markers=list(made))
