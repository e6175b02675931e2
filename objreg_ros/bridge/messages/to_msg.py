# SPDX-License-Identifier: Apache-2.0
"""The data types of data/ as ROS messages; the other direction is `from_msg`.

Every function is pure: values in, one message out. Stamps and frame ids are those of the values. `layout` explains
the fields of the tables.
"""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, TransformStamped, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry as OdometryMsg
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header, String

from objreg_ros import limits
from objreg_ros.bridge.messages import masks
from objreg_ros.bridge.messages.layout import (
    DETECTIONS,
    LANDMARKS,
    MOST_WHOLE,
    OBJECTS,
    SUPPORT_ID,
    SURPLUS,
    UNNAMED_ID,
    VIEW,
    fields_of,
)
from objreg_ros.data.closures import LoopClosure, Observation
from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, Odometry
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.geometry import quaternion_from_rotation

Array = NDArray[Any]

Labels = Mapping[int, str]


def stamp(stamp_ns: int) -> Time:
    """Integer nanoseconds as a Time; ValueError for what its 32 bits of seconds do not hold."""
    if not limits.LEAST_STAMP_NS <= stamp_ns <= limits.MOST_STAMP_NS:
        raise ValueError(f"stamp: expected seconds of 32 bits, got {stamp_ns} ns")
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def header(stamp_ns: int, frame_id: str) -> Header:
    """A Header."""
    return Header(stamp=stamp(stamp_ns), frame_id=frame_id)


def moment(frame_id: str, stamp_ns: int) -> str:
    """The name of a camera at one time, ``"<frame_id>@<sec>.<nsec, 9 digits>"``."""
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return f"{frame_id}@{sec}.{nanosec:09d}"


def clock(stamp_ns: int) -> Clock:
    """Simulated time."""
    return Clock(clock=stamp(stamp_ns))


def finished(node: str, stamp_ns: int, reason: str = "") -> Header:
    """The acknowledgement of one input frame: what became of it at ``node``, dropped if there is a ``reason``."""
    return header(stamp_ns, f"{node} dropped {reason}" if reason else f"{node} published")


def followed(node: str, stamp_ns: int) -> Header:
    """The acknowledgement of a frame whose own work is done at ``node``, while the keyframe that it completed waits."""
    return header(stamp_ns, f"{node} followed")


# Pictures and clouds


def image(picture: ColourImage) -> Image:
    """A colour image as rgb8."""
    return _raster(picture.rgb, "rgb8", picture.stamp_ns, picture.frame_id)


def depth_image(picture: DepthImage, millimetres: bool = False) -> Image:
    """The depth as 32FC1 metres, or rounded to 16UC1 millimetres (0 where it does not fit)."""
    if not millimetres:
        return _raster(picture.depth, "32FC1", picture.stamp_ns, picture.frame_id)
    depth = np.rint(picture.depth * 1000.0)
    depth = np.where(depth <= np.iinfo(np.uint16).max, depth, 0).astype("<u2")
    return _raster(depth, "16UC1", picture.stamp_ns, picture.frame_id)


def camera_info(intrinsics: Intrinsics, stamp_ns: int, frame_id: str) -> CameraInfo:
    """A camera without distortion."""
    K = [intrinsics.fx, 0.0, intrinsics.cx, 0.0, intrinsics.fy, intrinsics.cy, 0.0, 0.0, 1.0]
    return CameraInfo(
        header=header(stamp_ns, frame_id),
        width=intrinsics.width,
        height=intrinsics.height,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=K,
        r=np.eye(3).ravel(),
        p=np.hstack([np.reshape(K, (3, 3)), np.zeros((3, 1))]).ravel(),
    )


def points(cloud: PointCloud) -> PointCloud2:
    """A sensor's cloud, x y z and rgb where there is colour; NaN stays NaN."""
    packed = None if cloud.rgb is None else _packed(cloud.rgb)
    return _table(_xyz_rgb(cloud.xyz, packed), cloud.stamp_ns, cloud.frame_id)


def _raster(pixels: Array, encoding: str, stamp_ns: int, frame_id: str) -> Image:
    height, width = pixels.shape[:2]
    return Image(
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=pixels.strides[0] if pixels.flags.c_contiguous else pixels.nbytes // max(height, 1),
        data=_bytes(pixels),
    )


def _bytes(values: Array) -> array[int]:
    """The bytes of an array as rclpy takes them without looking at each (0.2 ms for 5 MB; a list takes 100)."""
    filled = array("B")
    filled.frombytes(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return filled


def _packed(rgb: Array) -> Array:
    """(..., 3) uint8 as 0x00RRGGBB."""
    r, g, b = (rgb[..., channel].astype("<u4") for channel in range(3))
    return r << np.uint32(16) | g << np.uint32(8) | b


def _xyz_rgb(xyz: Array, packed: Array | None) -> Array:
    layout = VIEW if packed is not None else _without_rgb(VIEW)
    records = np.empty(xyz.shape[:2], layout)
    for axis, name in enumerate("xyz"):
        records[name] = xyz[..., axis]
    if packed is not None:
        records["rgb"] = packed
    return records


def _without_rgb(layout: np.dtype[Any]) -> np.dtype[Any]:
    """A cloud without colour has no field for it: no colour is not black."""
    return np.dtype([(name, layout[name].str) for name in layout.names or () if name != "rgb"])


def _table(records: Array, stamp_ns: int, frame_id: str) -> PointCloud2:
    height, width = records.shape
    fields = [
        PointField(name=name, offset=offset, datatype=kind, count=math.prod(records.dtype[name].shape))
        for name, offset, kind in fields_of(records.dtype)
    ]
    return PointCloud2(
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=False,
        point_step=records.itemsize,
        row_step=records.itemsize * width,
        data=_bytes(records),
        is_dense=all(bool(np.isfinite(records[axis]).all()) for axis in "xyz" if axis in (records.dtype.names or ())),
    )


# Between the nodes


def labels(names: Labels) -> String:
    """The label table, JSON ``{"id": "name"}``; ValueError for an id that the tables cannot carry."""
    most = max(names, default=0)
    if most > limits.MOST_CLASS_ID:
        raise ValueError(f"labels: expected ids of at most {limits.MOST_CLASS_ID}, got {most}")
    return String(data=json.dumps({str(number): name for number, name in names.items()}))


def detections_table(detections: Detections, names: Labels) -> PointCloud2:
    """Detections as a typed table, one record a box; ValueError for a label that ``names`` does not hold.

    And for a picture whose size does not fit into 16 bits. Masks are one more column (`masks`).
    """
    size = detections.image_hw
    if max(size) > MOST_WHOLE:
        raise ValueError(f"detections: expected a picture of at most {MOST_WHOLE} pixels a side, got {size}")
    records = np.zeros((1, len(detections)), DETECTIONS)
    for column, name in enumerate(("x_min", "y_min", "x_max", "y_max")):
        records[name] = detections.xyxy[:, column]
    numbers = _numbers(names)
    records["score"] = detections.score
    records["class_id"] = [_number(label, numbers) for label in detections.label]
    records["image_height"], records["image_width"] = detections.image_hw
    return _table(masks.with_masks(records, detections), detections.stamp_ns, detections.frame_id)


def surplus(stamp_ns: int, frame_id: str) -> PointCloud2:
    """What the ``detections_table`` of a picture is that nobody looked at, to keep a pace: one column, without rows."""
    return _table(np.zeros((0, 0), SURPLUS), stamp_ns, frame_id)


def objects(frame: Frame, names: Labels) -> PointCloud2:
    """The objects of a frame and its support surface in one cloud; empty for a frame without any.

    ValueError for a label that ``names`` does not hold.
    """
    clouds = [cloud for cloud in (frame.support, *frame.objects) if cloud is not None]
    coloured = any(cloud.rgb is not None for cloud in clouds)
    records = np.zeros((1, sum(len(cloud) for cloud in clouds)), OBJECTS if coloured else _without_rgb(OBJECTS))
    numbers, first = _numbers(names), 0
    for cloud in clouds:
        number = SUPPORT_ID if cloud.instance == 0 else _number(cloud.label, numbers)
        _fill(records[0, first : first + len(cloud)], cloud, number)
        first += len(cloud)
    return _table(records, frame.stamp_ns, frame.frame_id)


def _fill(records: Array, cloud: ObjectCloud, class_id: int) -> None:
    for axis, name in enumerate("xyz"):
        records[name] = cloud.xyz[:, axis]
        records[f"normal_{name}"] = cloud.normals[:, axis]
    if cloud.rgb is not None:
        records["rgb"] = _packed(cloud.rgb)
    records["score"], records["density"] = cloud.score, cloud.density
    records["class_id"], records["instance"], records["flags"] = class_id, cloud.instance, cloud.flags


def _numbers(names: Labels) -> dict[str, int]:
    """name → id; the first id of a name that occurs twice."""
    return {name: number for number, name in reversed(list(names.items()))}


def _is_numbered(label: str, numbers: Mapping[str, int]) -> bool:
    return label in numbers or label == UNNAMED or (label.isdecimal() and int(label) <= limits.MOST_CLASS_ID)


def _number(label: str, numbers: Mapping[str, int]) -> int:
    """The id of a label. The label of a class without a name is its number, in both directions."""
    if not _is_numbered(label, numbers):
        raise ValueError(f"label {label!r}: expected one of the {len(numbers)} published labels")
    return UNNAMED_ID if label == UNNAMED else numbers[label] if label in numbers else int(label)


def class_id(label: str, names: Labels) -> int | None:
    """The number of a label in the tables; None for one that ``names`` does not hold."""
    numbers = _numbers(names)
    return _number(label, numbers) if _is_numbered(label, numbers) else None


def view(frame: Frame) -> PointCloud2:
    """The reduced view, organised; rgb is the grey, and missing where there is none."""
    grey = frame.view.grey
    packed = None if grey is None else _packed(np.repeat(grey[..., None], 3, axis=-1))
    return _table(_xyz_rgb(frame.view.xyz, packed), frame.stamp_ns, frame.frame_id)


def view_camera_info(frame: Frame) -> CameraInfo:
    """The reduced camera of the view."""
    return camera_info(frame.view.intrinsics, frame.stamp_ns, frame.frame_id)


def gravity(frame: Frame) -> Vector3Stamped:
    """The direction of gravity; its length is the confidence, 0 where unknown."""
    known = np.zeros(3) if frame.gravity is None else frame.gravity * frame.gravity_confidence
    return Vector3Stamped(header=header(frame.stamp_ns, frame.frame_id), vector=_vector(known))


# Poses


def pose(T: Array) -> Pose:
    """A (4, 4) motion."""
    x, y, z = T[:3, 3].tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=_quaternion(T))


def odometry(sample: Odometry) -> OdometryMsg:
    """The pose of a body; the covariance is left at zero, which says unknown."""
    message = OdometryMsg(header=header(sample.stamp_ns, sample.frame_id), child_frame_id=sample.child_frame_id)
    message.pose.pose = pose(sample.T_odom_body)
    return message


def constraint(closure: LoopClosure) -> OdometryMsg:
    """A loop closure: frame *from* in the header, frame *to* as the child, the stamp of *to*."""
    parent, child = _moments(closure)
    message = OdometryMsg(header=header(closure.to_ns, parent), child_frame_id=child)
    message.pose.pose = pose(closure.T_from_to)
    message.pose.covariance = closure.covariance.ravel()
    return message


def _moments(closure: LoopClosure) -> tuple[str, str]:
    """The names of *from* and *to*."""
    return moment(closure.from_frame_id, closure.from_ns), moment(closure.to_frame_id, closure.to_ns)


def transforms(closure: LoopClosure) -> list[TransformStamped]:
    """The registration once for each object that it aligns with itself.

    The child frame is ``"<moment(to)>/<label>_<id of the landmark>"``.
    """
    parent, child = _moments(closure)
    names = [f"{child}/{match.label}_{match.object_id}" for match in closure.objects]
    return [transform(closure.T_from_to, closure.to_ns, parent, name) for name in names]


def landmarks(observations: Sequence[Observation], stamp_ns: int, frame_id: str, names: Labels) -> PointCloud2:
    """The objects of a keyframe in the camera ``frame_id``, one record each, with the ids of their landmarks.

    Without those of a label that ``names`` does not hold: it is of a model that another has replaced meanwhile.
    """
    numbers = _numbers(names)
    numbered = [seen for seen in observations if _is_numbered(seen.label, numbers)]
    records = np.zeros((1, len(numbered)), LANDMARKS)
    for axis, name in enumerate("xyz"):
        records[name] = [seen.xyz[axis] for seen in numbered]
    records["object_id"] = [seen.object_id for seen in numbered]
    records["class_id"] = [_number(seen.label, numbers) for seen in numbered]
    return _table(records, stamp_ns, frame_id)


def transform(T_parent_child: Array, stamp_ns: int, parent: str, child: str) -> TransformStamped:
    """The pose of a frame in another."""
    motion = Transform(translation=_vector(T_parent_child[:3, 3]), rotation=_quaternion(T_parent_child))
    return TransformStamped(header=header(stamp_ns, parent), child_frame_id=child, transform=motion)


def path(poses: Iterable[tuple[int, Array]], stamp_ns: int, frame_id: str) -> Path:
    """Stamps in nanoseconds and poses (4, 4) in ``frame_id``, as they are known at ``stamp_ns``."""
    stamped = [PoseStamped(header=header(when, frame_id), pose=pose(T)) for when, T in poses]
    return Path(header=header(stamp_ns, frame_id), poses=stamped)


def _vector(xyz: Array) -> Vector3:
    x, y, z = xyz.tolist()
    return Vector3(x=x, y=y, z=z)


def _quaternion(T: Array) -> Quaternion:
    x, y, z, w = quaternion_from_rotation(T[:3, :3]).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
