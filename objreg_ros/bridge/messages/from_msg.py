# SPDX-License-Identifier: Apache-2.0
"""Messages to the data types of data/. Only this module and `closures_msg` know the fields of incoming messages.

Reads attributes only, so the messages of rclpy and of rosbags (ROS 1 and 2) both fit. Pixels are in `pictures`, records
in `layout`. A message that breaks its contract raises ValueError with what was expected and what came.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits
from objreg_ros.bridge.messages import masks
from objreg_ros.bridge.messages.camera_from_msg import intrinsics
from objreg_ros.bridge.messages.headers import bounded, stamp_ns, stamp_within_limits, when_and_where
from objreg_ros.bridge.messages.layout import (
    SUPPORT_ID,
    SUPPORT_LABEL,
    SURPLUS,
    UNNAMED_ID,
    columns,
    table,
    whole_numbers,
)
from objreg_ros.bridge.messages.motion_from_msg import motion, pose_at
from objreg_ros.bridge.messages.pictures import colour_pixels, depth_metres, unpack_rgb
from objreg_ros.data.checked import SURROGATE
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, Odometry, View
from objreg_ros.data.images import ColourImage, DepthImage, Detections, PointCloud

Array = NDArray[Any]

MOMENT = re.compile(r"(?P<name>.*)@(?P<seconds>-?[0-9]{1,10})\.(?P<nanoseconds>[0-9]{9})", re.DOTALL)


# ------------------------------------------------------------------------------------------------------------- cameras


def image(message: Any, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE) -> ColourImage:
    """An Image (of an encoding in `pictures.COLOUR` or `PLANES`) or CompressedImage (jpeg, png), or its value."""
    if isinstance(message, ColourImage):
        return message
    return ColourImage(rgb=colour_pixels(message, most_pixels), **when_and_where(message))


def depth(message: Any, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE) -> Array:
    """Metres (H, W) float32, 0 where there is none, of an Image (16UC1, mono16: mm; 32FC1: m) or a compressedDepth."""
    return depth_metres(message, most_pixels)


def depth_image(
    depth_message: Any, camera_info: Any, colour: Any = None, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE
) -> DepthImage:
    """The depth image of a depth message, its CameraInfo and, if given, the colour message registered to it.

    Colour of another size is left out: it is not registered to this depth.
    """
    metres = depth(depth_message, most_pixels)
    camera = intrinsics(camera_info)
    if metres.shape != (camera.height, camera.width):
        got = f"{metres.shape[1]} × {metres.shape[0]}"
        raise ValueError(f"depth: expected camera_info's size {camera.width} × {camera.height}, got {got} pixels")
    rgb = None if colour is None else image(colour, most_pixels).rgb
    rgb = rgb if rgb is not None and rgb.shape[:2] == metres.shape else None
    return DepthImage(depth=metres, rgb=rgb, intrinsics=camera, **when_and_where(depth_message))


def point_cloud(message: Any) -> PointCloud:
    """A PointCloud2 with x y z and, if it has them, rgb or rgba; N × 1 comes as 1 × N. NaN where not measured."""
    records = table(message, "x", "y", "z")
    if records.size == 0:
        raise ValueError(f"cloud: expected points, got {message.width} × {message.height}")
    if records.shape[1] == 1:
        records = records.reshape(1, -1)
    xyz = columns(records, "x", "y", "z")
    finite = np.isfinite(xyz)
    if not finite.all():
        measured = finite[..., 0] & finite[..., 1] & finite[..., 2]
        xyz += np.where(measured, np.float32(0), np.float32(np.nan))[..., None]
    return PointCloud(xyz=xyz, rgb=_colours(records), **when_and_where(message))


def _colours(records: Array) -> Array | None:
    names = records.dtype.names or ()
    packed = next((name for name in ("rgb", "rgba") if name in names), None)
    return None if packed is None else unpack_rgb(records[packed])


# --------------------------------------------------------------------------------------------------------------- poses


def loop_closure(message: Any) -> LoopClosure:
    """A constraint (nav_msgs/Odometry, frames ``name@sec.nsec``); its labels and evidence do not travel with it."""
    from_frame_id, from_ns = moment(message.header.frame_id)
    to_frame_id, to_ns = moment(message.child_frame_id)
    return LoopClosure(
        from_ns=from_ns,
        to_ns=to_ns,
        T_from_to=motion(message),
        covariance=np.asarray(message.pose.covariance, np.float64).reshape(6, 6),
        labels=(),
        from_frame_id=from_frame_id,
        to_frame_id=to_frame_id,
    )


def moment(frame_id: str) -> tuple[str, int]:
    """The frame, of whatever name, and the time in ns of ``name@sec.nsec`` with nine digits behind the point."""
    found = MOMENT.fullmatch(bounded(frame_id, "constraint"))
    if found is None:
        raise ValueError(f"constraint: expected a frame_id like camera@12.000000034, got {frame_id!r}")
    seconds, nanoseconds = int(found["seconds"]), int(found["nanoseconds"])
    return found["name"], stamp_within_limits(seconds * limits.NANOSECONDS + nanoseconds)


# --------------------------------------------------------------------------------------------------- between the nodes


def labels(message: Any) -> dict[int, str]:
    """The names of the classes: std_msgs/String with JSON ``{"id": "name"}``."""
    if len(message.data) > limits.MOST_LABELS_TEXT:
        raise ValueError(f"labels: expected at most {limits.MOST_LABELS_TEXT} characters, got {len(message.data)}")
    try:
        pairs = json.loads(message.data).items()
        return {_class_id(number): checked_label(name) for number, name in pairs}
    except (ValueError, AttributeError, RecursionError) as error:
        got = f"{message.data[:80]!r} ({error})"
        raise ValueError(f'labels: expected JSON like {{"0": "cup"}}, got {got}') from error


def _class_id(text: str) -> int:
    number = int(text)
    if not 0 <= number <= limits.MOST_CLASS_ID:
        raise ValueError(f"expected an id of 0 to {limits.MOST_CLASS_ID}, got {number}")
    return number


def checked_label(name: Any) -> str:
    """The name of a class, or what a detector calls one of its boxes; ValueError for one that cannot be passed on."""
    if not isinstance(name, str) or SURROGATE.search(name):
        raise ValueError(f"expected a name that UTF-8 can write, got {ascii(name)[:80]}")
    return bounded(name, "label")


def is_surplus(message: Any) -> bool:
    """Whether a ``detections_table`` says that its picture was left out to keep a pace."""
    return tuple(field.name for field in message.fields) == SURPLUS.names


def detections(message: Any, names: Mapping[int, str], image_hw: tuple[int, int] = (1, 1)) -> Detections:
    """A ``detections_table``, or a `Detections`. The label of a class without a name is its number.

    ``image_hw`` is the size where the message has none: that of an empty table.
    """
    if isinstance(message, Detections):
        return message
    xyxy, score, label, stated_hw = _rows_of_table(message, names)
    order = np.argsort(-score, kind="stable")
    found = Detections(
        xyxy=np.ascontiguousarray(xyxy[order]),
        score=np.ascontiguousarray(score[order]),
        label=tuple(label[i] for i in order),
        image_hw=stated_hw or image_hw,
        **when_and_where(message),
    )
    return replace(found, instances=masks.read_masks(table(message).reshape(-1)[order], found))


Rows = tuple[Array, Array, list[str], tuple[int, int] | None]


def _rows_of_table(message: Any, names: Mapping[int, str]) -> Rows:
    corners = ("x_min", "y_min", "x_max", "y_max")
    rows = table(message, *corners, "score", "class_id", "image_width", "image_height").reshape(1, -1)
    if rows.shape[1] > limits.MOST_DETECTIONS:
        raise ValueError(f"detections: expected at most {limits.MOST_DETECTIONS} boxes, got {rows.shape[1]}")
    label = [names.get(number, str(number)) for number in whole_numbers(rows, "class_id")[0].tolist()]
    height, width = whole_numbers(rows, "image_height"), whole_numbers(rows, "image_width")
    image_hw = (int(height[0, 0]), int(width[0, 0])) if rows.size else None
    return columns(rows, *corners)[0], columns(rows, "score")[0, :, 0], label, image_hw


def objects(message: Any, names: Mapping[int, str]) -> tuple[tuple[ObjectCloud, ...], ObjectCloud | None]:
    """The objects (instance 1 and up, in order) and the support surface (instance 0) of an ``objects`` cloud."""
    needed = ("x", "y", "z", "normal_x", "normal_y", "normal_z", "score", "density", "class_id", "instance", "flags")
    rows = table(message, *needed).reshape(1, -1)
    if rows.shape[1] > limits.MOST_OBJECT_POINTS:
        raise ValueError(f"objects: expected at most {limits.MOST_OBJECT_POINTS} points, got {rows.shape[1]}")
    instance, number = whole_numbers(rows, "instance")[0], whole_numbers(rows, "class_id")[0]
    flags = whole_numbers(rows, "flags")[0].astype(np.uint16)
    if (np.diff(instance) < 0).any():  # ours come in order
        order = np.argsort(instance, kind="stable")
        rows, instance, number, flags = rows[:, order], instance[order], number[order], flags[order]
    starts = np.flatnonzero(np.diff(instance)) + 1
    if not (rows["z"] >= limits.LEAST_RANGE).all():
        raise ValueError(f"objects: expected points in front of the camera, got one at z = {rows['z'].min()} m")
    if len(starts) > limits.MOST_OBJECTS:
        raise ValueError(f"objects: expected at most {limits.MOST_OBJECTS} objects, got {len(starts) + 1}")
    bounds = [0, *starts.tolist(), rows.shape[1]]
    parts = [slice(first, last) for first, last in itertools.pairwise(bounds) if last > first]
    clouds = [
        _object(rows[:, part], int(instance[part.start]), _label_of(int(number[part.start]), names), flags[part])
        for part in parts
    ]
    support = next((cloud for cloud in clouds if cloud.instance == 0), None)
    return tuple(cloud for cloud in clouds if cloud.instance > 0), support


def _label_of(number: int, names: Mapping[int, str]) -> str:
    own = {SUPPORT_ID: SUPPORT_LABEL, UNNAMED_ID: UNNAMED}
    return own[number] if number in own else names.get(number, str(number))


def _object(rows: Array, instance: int, label: str, flags: Array) -> ObjectCloud:
    score, density = columns(rows[:, :1], "score", "density")[0, 0].tolist()
    colours = _colours(rows)
    return ObjectCloud(
        label=label,
        score=score,
        instance=instance,
        xyz=columns(rows, "x", "y", "z")[0],
        normals=columns(rows, "normal_x", "normal_y", "normal_z")[0],
        rgb=None if colours is None else colours[0],
        flags=flags,
        density=density,
    )


def view(message: Any, camera_info: Any) -> View:
    """The reduced frame: an organised cloud whose rgb, if it has one, is grey."""
    if int(message.width) * int(message.height) > limits.MOST_VIEW_PIXELS:
        size = f"{message.width} × {message.height}"
        raise ValueError(f"view: expected at most {limits.MOST_VIEW_PIXELS} pixels, got {size}")
    cloud = point_cloud(message)
    grey = None if cloud.rgb is None else np.ascontiguousarray(cloud.rgb[..., 0])
    return View(xyz=cloud.xyz, grey=grey, intrinsics=intrinsics(camera_info))


def gravity(message: Any) -> tuple[Array | None, float]:
    """The unit direction of gravity (3,) and its confidence 0..1 of a Vector3Stamped; None and 0 if unknown."""
    return split_gravity(np.array([message.vector.x, message.vector.y, message.vector.z], float))


def split_gravity(vector: Array) -> tuple[Array | None, float]:
    """The direction and the confidence of a gravity vector whose length is the confidence."""
    confidence = float(np.linalg.norm(vector))
    return (vector / confidence, min(confidence, 1.0)) if 1e-9 < confidence < np.inf else (None, 0.0)


def frame(
    objects_message: Any,
    view_message: Any,
    view_info: Any,
    gravity_message: Any,
    names: Mapping[int, str],
    odometries: Sequence[Odometry] | None = None,
    T_body_camera: Array | None = None,
) -> Frame:
    """One frame from the segmenter's four messages, which must have one stamp, and the odometry around it, if any.

    ``T_body_camera`` is the pose of the camera on the body of the odometry; the identity if None.
    """
    stamps = [stamp_ns(m) for m in (objects_message, view_message, view_info, gravity_message)]
    if len(set(stamps)) != 1:
        raise ValueError(f"frame: expected objects, view, camera_info and gravity of one stamp, got {stamps} ns")
    clouds, support = objects(objects_message, names)
    falls, confidence = gravity(gravity_message)
    return Frame(
        objects=clouds,
        support=support,
        view=view(view_message, view_info),
        gravity=falls,
        gravity_confidence=confidence,
        T_odom_camera=_camera_pose(stamps[0], odometries, T_body_camera),
        **when_and_where(objects_message),
    )


def followed(unplaced: Frame, odometries: Sequence[Odometry] | None, T_body_camera: Array | None = None) -> Frame:
    """The segmenter's own frame, with the odometry around it as in `frame`."""
    return replace(unplaced, T_odom_camera=_camera_pose(unplaced.stamp_ns, odometries, T_body_camera))


def _camera_pose(moment_ns: int, samples: Sequence[Odometry] | None, T_body_camera: Array | None) -> Array | None:
    T_odom_body = pose_at(moment_ns, samples) if samples else None
    return T_odom_body if T_odom_body is None or T_body_camera is None else T_odom_body @ T_body_camera
