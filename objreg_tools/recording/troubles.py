# SPDX-License-Identifier: Apache-2.0
"""Problems and missing inputs of a recording, found before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.camera.camera_checks import check_camera
from objreg_ros.bridge.camera.frames import FrameTie
from objreg_ros.bridge.messages import camera_from_msg, from_msg
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.plausibility.finding import Finding
from objreg_ros.plausibility.findings import two_cameras
from objreg_tools.recording.inputs import Inputs, depth_of_others
from objreg_tools.recording.mounts import camera_on_body, first_frames, first_readable, frame_of, frame_tree
from objreg_tools.recording.record import Record, Recording
from objreg_tools.recording.stamps import stamps

MOMENTS = 5  # of a recording at which its depth is looked at
NEVER_ALL_BEYOND_M = 3.0  # a depth camera indoors always has something nearer: its floor, a table, a wall
NEVER_ALL_WITHIN_M = 0.15  # nearer than any depth camera measures

REGISTER = (
    "record registered depth (RealSense: align_depth.enable:=true, OpenNI: depth_registered), or /tf_static between "
    "the two frames and the camera_info of both: then it is registered here"
)
RECORD_UNITS = "record depth in mm (16UC1) or in m (32FC1); a TUM folder names its steps as depth_scale in camera.yaml"

OF_FILES = "the topics of a folder are made of its files, and each that it can have is there unless it was ruled out"
FOLDER = "give the folder what is missing, or leave out --remap"
CAMERA_YAML = (
    "give camera.yaml the width, height, fx, fy, cx and cy of the depth pictures, or name --camera fx,fy,cx,cy"
)
NAME_INFO = "name the right one with --remap camera_info:=/topic, or give the camera with --camera fx,fy,cx,cy"
REGISTER_FILES = "export depth and colour of one field of view: depth that is registered to colour"


def missing(inputs: Inputs, of_pictures: bool = False) -> Finding | None:
    """The obstacle that keeps the graph from running, or None. ``of_pictures`` is that of the recording."""
    if not inputs.missing:
        return None
    if of_pictures:
        return Finding(f"the graph cannot run: expected {inputs.missing}", OF_FILES, FOLDER, "waits-for-a-topic")
    lacks_camera = inputs.image and (inputs.points or inputs.depth)
    return Finding(
        f"the graph cannot run: expected {inputs.missing}",
        "it is not recorded, or under a name that is not recognised",
        "if it is there, name it with --remap input:=/topic" + (", or --camera fx,fy,cx,cy" if lacks_camera else ""),
        "no-camera-info" if lacks_camera else "waits-for-a-topic",
    )


def unpaired(recording: Recording, inputs: Inputs) -> Finding | None:
    """Colour and depth of two cameras, of which none was chosen; None where that is not so."""
    others = depth_of_others(recording.topics, inputs, first_frames(recording))
    return two_cameras(str(inputs.image), others[0]) if others else None


def warnings(recording: Recording, inputs: Inputs) -> list[Finding]:
    """The problems and missing inputs, and their remedies; empty if none."""
    lacking = unpaired(recording, inputs) or missing(inputs, recording.of_pictures)
    found = [Finding(note) for note in recording.notes] + ([lacking] if lacking else [])
    if inputs.odom is None:
        found.append(Finding("no odometry: the registrar follows the camera by itself, and the gate is less strict"))
    if inputs.ground_truth is None:
        found.append(Finding("no ground truth: the true error of constraints is not known"))
    found += map(Finding, [*_mount_of_camera(recording, inputs), *_mount_of_imu(recording, inputs)])
    for look in (_first_messages, _camera, _registration, stamps, _scale):
        found += look(recording, inputs)
    return found


def troubles(recording: Recording, inputs: Inputs) -> list[Finding]:
    """The warnings that a run of the recording repeats: those that may be why it finds little."""
    return [finding for finding in warnings(recording, inputs) if finding.anchor]


def _first_messages(recording: Recording, inputs: Inputs) -> list[Finding]:
    """The findings that the nodes would report of the first messages."""
    found: list[Finding] = []
    _try(found, "image", recording, inputs.image, from_msg.image)
    depth = _try(found, "depth", recording, inputs.depth, lambda m: from_msg.depth(m).shape)
    cloud = _try(found, "points", recording, inputs.points, from_msg.point_cloud)
    read = camera_from_msg.intrinsics if cloud is None else partial(camera_from_msg.camera_of_cloud, cloud=cloud)
    camera: Intrinsics | None = _try(found, "camera_info", recording, inputs.camera_info, read)
    if camera and depth and depth != (camera.height, camera.width):
        found.append(
            Finding(
                f"depth has {_size(depth)} pixels and its camera_info {camera.width} × {camera.height}",
                "the camera_info is of another picture, so every frame would be dropped",
                CAMERA_YAML if recording.of_pictures else NAME_INFO,
                "no-camera-info",
            )
        )
    if cloud is not None and not cloud.organised and camera is None:
        found.append(
            Finding(
                "points are not organised and there is no camera_info to project them with",
                "they are of a driver that leaves out pixels without depth",
                "name a camera_info with --remap camera_info:=/topic, or give the camera with --camera fx,fy,cx,cy",
                "no-camera-info",
            )
        )
    return found


def _try(
    found: list[Finding], name: str, recording: Recording, topic: str | None, decode: Callable[[Any], Any]
) -> Any | None:
    record = _first(recording, topic)
    try:
        return None if record is None else decode(record.message)
    except ValueError as error:
        found.append(Finding(f"{name}: {error}"))
        return None


def _camera(recording: Recording, inputs: Inputs) -> list[Finding]:
    """Whether the camera can be that of its pictures."""
    info, colour_info = (first_readable(recording, topic) for topic in (inputs.camera_info, inputs.colour_info))
    one_frame = _frame_id(recording, inputs.image) == _frame_id(recording, inputs.depth)
    try:
        return [] if info is None else check_camera(info, colour_info, one_frame)
    except ValueError:
        return []  # said where the first messages are looked at


def _size(hw: tuple[int, int]) -> str:
    return f"{hw[1]} × {hw[0]}"


def _registration(recording: Recording, inputs: Inputs) -> list[Finding]:
    """Whether depth is registered to colour: by the driver, by us, or by nobody."""
    topics = inputs.image, inputs.depth, inputs.camera_info, inputs.colour_info
    colour, depth, info, colour_info = (first_readable(recording, topic) for topic in topics)
    if colour is None or depth is None or info is None:
        return []
    try:
        picture, size = from_msg.image(colour), from_msg.depth(depth).shape
        from_msg.depth_image(depth, info)
    except ValueError:
        return []  # said where the first messages are looked at
    raw = lenses.raw_pictures("auto", inputs.depth, inputs.image)
    cameras = colour_frame.Cameras(info, colour_info, colour_frame.named_registered(inputs.depth, inputs.image))
    try:
        seen = colour_frame.depth_image(depth, cameras, picture, frame_tree(recording).between, raw)
    except ValueError as error:
        what = f"colour has {_size(picture.rgb.shape[:2])} pixels and depth {_size(size)}: {error}"
        return [Finding(what, "every frame would be dropped", _register(recording), "depth-is-not-registered")]
    if seen.registered:
        return [Finding(seen.registered)]
    todo = _register(recording)
    return [*_sizes(picture.rgb.shape[:2], size, todo), *_frames(frame_of(colour), frame_of(depth), todo)]


def _register(recording: Recording) -> str:
    """The remedy for depth that is not registered."""
    return REGISTER_FILES if recording.of_pictures else REGISTER


def _sizes(colour: tuple[int, int], depth: tuple[int, int], todo: str) -> Iterator[Finding]:
    """Whether the two pictures have as many pixels."""
    if colour != depth:
        what = f"colour has {_size(colour)} pixels and depth {_size(depth)}"
        cause = "they must show the same field of view, and depth that is not registered to colour seldom does"
        yield Finding(what, cause, todo, "depth-is-not-registered")


def _frames(colour: str, depth: str, todo: str) -> Iterator[Finding]:
    """Whether a depth image is in the frame of colour, as one that is registered to it is."""
    if colour and depth and colour != depth:
        what = f"colour is in the frame {colour} and depth in {depth}"
        cause = "depth that is not registered to colour gives wrong objects"
        yield Finding(what, cause, todo, "depth-is-not-registered")


def _mount_of_camera(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether it is known how the camera sits on the body of the odometry."""
    mounted = camera_on_body(recording, inputs)
    body, camera = mounted.body, mounted.camera
    if mounted.tie is FrameTie.MOVING:
        return [f"the camera's {camera} moves on the odometry's {body} by a joint on /tf, which is followed"]
    if mounted.tie is FrameTie.CONSTANT and body != camera:
        return [f"the camera's {camera} is mounted on the odometry's {body} by /tf, which repeats the same"]
    if mounted.tie is not None or body == camera:
        return []
    return [
        f"odometry is of {body} and depth in {camera}, and neither /tf_static nor /tf ties them: the mount is measured "
        "from the motion, if that suffices; set T_base_camera of registrar and mapper if you know it"
    ]


def _mount_of_imu(recording: Recording, inputs: Inputs) -> list[str]:
    """Whether it is known how the IMU sits on the camera."""
    camera, imu = (_frame_id(recording, topic) for topic in (inputs.depth or inputs.points, inputs.imu))
    if not camera or not imu or camera == imu or frame_tree(recording, camera, imu).tie(camera, imu) is not None:
        return []
    return [
        f"the IMU is in the frame {imu} and depth in {camera}, and neither /tf_static nor /tf ties them: it gives "
        "gravity only with segmenter.T_camera_imu, its pose in the camera's optical frame"
    ]


def _frame_id(recording: Recording, topic: str | None) -> str:
    """The frame of a topic's first message; empty if it names none."""
    return frame_of(first_readable(recording, topic))


def _scale(recording: Recording, inputs: Inputs) -> Iterator[Finding]:
    """Whether the values of depth can be metres or millimetres at all."""
    ranges = [reach for metres in _depths(recording, inputs.depth) if (reach := _reach_m(metres)) is not None]
    if not ranges:
        return
    near, far = np.median(ranges, axis=0)
    if near > NEVER_ALL_BEYOND_M:
        cause = "a room always has something nearer: depth is in other steps than its encoding says, as of 0.2 mm"
        yield Finding(f"depth begins at {near:.1f} m", cause, RECORD_UNITS, "depth-scale")
    elif far < NEVER_ALL_WITHIN_M:
        cause = "no depth camera sees so near: these may be metres in a picture of millimetres"
        yield Finding(f"depth ends at {far:.3g} m", cause, RECORD_UNITS, "depth-scale")


def _depths(recording: Recording, topic: str | None) -> Iterator[Array]:
    """Depth (H, W) m at some times of the recording; those that do not decode are left out."""
    span_ns = recording.end_ns - recording.start_ns
    for k in range(MOMENTS if topic else 0):
        record = next(recording.records([topic or ""], recording.start_ns + k * span_ns // MOMENTS), None)
        message = None if record is None else record.read()
        try:
            if message is not None:
                yield from_msg.depth(message)
        except ValueError:
            continue


def _reach_m(metres: Array) -> tuple[float, float] | None:
    """Where depth begins and ends, a twentieth of its pixels aside; None where there is none."""
    valid = metres[np.isfinite(metres) & (metres > 0)]
    return None if not len(valid) else (float(np.quantile(valid, 0.05)), float(np.quantile(valid, 0.95)))


def _first(recording: Recording, topic: str | None) -> Record | None:
    return next(recording.records([topic]), None) if topic else None
