# SPDX-License-Identifier: Apache-2.0
"""Standard ROS 2 messages made and written without ROS, by the types that `rosbags` ships."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from objreg_ros.bridge.camera.calibration import Calibration
from objreg_ros.bridge.messages.layout import fields_of
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import quaternion_from_rotation

Array = NDArray[Any]

MISSING = object()
PADDING = "structure_needs_at_least_one_member"  # the field of a type without fields in some definitions
READ = tuple(
    f"{package}/msg/{name}"
    for package, names in (
        ("sensor_msgs", ("Image", "CompressedImage", "PointCloud2", "CameraInfo", "Imu")),
        ("geometry_msgs", ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped")),
        ("nav_msgs", ("Odometry",)),
        ("tf2_msgs", ("TFMessage",)),
    )
    for name in names
)  # the types whose fields are read here, and not only passed on
CDR_PREFIX = 4  # bytes before the fields; the second says the byte order


@cache
def standard_types() -> Typestore:
    """The message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def message(msgtype: str, **values: Any) -> Any:
    """A message of a type like ``sensor_msgs/Image`` with all its fields."""
    package, _, name = msgtype.partition("/")
    return standard_types().types[f"{package}/msg/{name}"](**values)


def serialise(made: Any) -> bytes:
    """The CDR bytes of a message of a standard type; of a ROS 1 message after it was brought up to date."""
    modern = modernise(made)
    return bytes(standard_types().serialize_cdr(modern, modern.__msgtype__))


def header_stamp_ns(cdr: bytes) -> int:
    """The stamp of a message that begins with a header, from its CDR bytes: nothing else is decoded."""
    if len(cdr) < CDR_PREFIX + 8:
        raise ValueError(f"expected the CDR bytes of a message with a header, got {len(cdr)} bytes")
    seconds, nanoseconds = struct.unpack_from("<iI" if cdr[1] & 1 else ">iI", cdr, CDR_PREFIX)
    return int(seconds) * 10**9 + int(nanoseconds)


def modernise(old: Any) -> Any:
    """A message with the fields that its type has in ROS 2: no ``seq`` in headers, small letters in CameraInfo."""
    types = standard_types().types
    if old.__msgtype__ not in types:
        raise ValueError(f"{old.__msgtype__}: expected a type that ROS 2 ships; leave its topic out")
    kind: Any = types[old.__msgtype__]
    if isinstance(old, kind):
        return old
    return kind(**{field.name: _modern_value(old, field.name) for field in _fields(kind)})


def obstacle(msgtype: str, types: Typestore) -> str:
    """Why messages of a type, as ``types`` know it, cannot be brought up to date, as text; empty if they can."""
    modern = standard_types().fielddefs.get(msgtype)
    if modern is None:
        return f"ROS 2 does not ship {msgtype}"
    there = dict(types.fielddefs.get(msgtype, modern)[1])
    for name, _ in modern[1]:
        field = there.get(name, there.get(name.upper()))
        if field is None:
            return f"{msgtype} has no {name}, which it has in ROS 2"
        inner = _inner_type(field)
        if inner and (why := obstacle(inner, types)):
            return why
    return ""


def difference(msgtype: str, types: Typestore) -> str:
    """Why the bytes of a type, as ``types`` know it, are not what ROS 2 Jazzy reads, as text; empty if they are."""
    ours = standard_types().fielddefs.get(msgtype)
    if ours is None:
        return f"ROS 2 does not ship {msgtype}"
    here, there = (_named_fields(fields) for fields in (ours[1], types.fielddefs.get(msgtype, ours)[1]))
    odd = [name for name, field in {**here, **there}.items() if here.get(name) != there.get(name)]
    if odd or list(here) != list(there):
        return f"{msgtype} has other fields than in ROS 2 Jazzy: {', '.join(odd) or 'their order'}"
    inner = (_inner_type(field) for field in here.values())
    return next((why for kind in inner if kind and (why := difference(kind, types))), "")


def misfit(msgtype: str, types: Typestore) -> str:
    """Why a message of a type, as ``types`` know it, cannot be read by our names, as text; empty if it can.

    What ROS 1 says more, and in capitals, is no obstacle, nor is another type of number.
    """
    ours = standard_types().fielddefs[msgtype][1]
    there = dict(types.fielddefs.get(msgtype, (None, ours))[1])
    for name, field in ours:
        theirs = there.get(name, there.get(name.upper()))
        if theirs is None or _form(theirs) != _form(field):
            return f"a definition of {msgtype} {'without' if theirs is None else 'with another'} {name}"
        inner = _inner_type(field)
        if inner and (why := misfit(inner, types)):
            return why
    return ""


def _form(field: Any) -> Any:
    """The kind of a field for a reader: a number, text, a message of a type or a list of them."""
    kind, of = field
    if kind is Nodetype.BASE:
        return "text" if "string" in of[0] else "number"
    return (_form(of[0]), of[1] if kind is Nodetype.ARRAY else 0) if kind is not Nodetype.NAME else of


def _named_fields(fields: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    return {name: field for name, field in fields if name != PADDING}


def _inner_type(field: Any) -> str:
    """The message type of a field or of its elements; empty for numbers and text."""
    kind, of = field
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return _inner_type(of[0])
    return str(of) if kind is Nodetype.NAME else ""


def _fields(kind: Any) -> Sequence[Any]:
    return [field for field in dataclasses.fields(kind) if field.init]


def _modern_value(old: Any, name: str) -> Any:
    value = getattr(old, name, getattr(old, name.upper(), MISSING))
    if value is MISSING:
        raise ValueError(f"{old.__msgtype__}: expected {name}, as in ROS 2, got no such field; leave its topic out")
    if hasattr(value, "__msgtype__"):
        return modernise(value)
    if isinstance(value, list):
        return [modernise(item) if hasattr(item, "__msgtype__") else item for item in value]
    return value


# -------------------------------------------------------------------------------------------------- the ones we need


def header(stamp_ns: int, frame_id: str) -> Any:
    """std_msgs/Header."""
    return message("std_msgs/Header", stamp=time(stamp_ns), frame_id=frame_id)


def time(stamp_ns: int) -> Any:
    """builtin_interfaces/Time."""
    return message("builtin_interfaces/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def image(pixels: Array, encoding: str, stamp_ns: int, frame_id: str) -> Any:
    """sensor_msgs/Image of pixels (H, W) or (H, W, C) whose dtype fits the encoding."""
    little = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<"))
    return message(
        "sensor_msgs/Image",
        header=header(stamp_ns, frame_id),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=little.strides[0],
        data=little.reshape(-1).view(np.uint8),
    )


def camera_info(camera: Intrinsics, stamp_ns: int, frame_id: str, distortion: Sequence[float] = (0,) * 5) -> Any:
    """sensor_msgs/CameraInfo of a pinhole camera with plumb-bob distortion."""
    K = (camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)
    P = (camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    calibration = Calibration(k=K, p=P, width=camera.width, height=camera.height, d=tuple(distortion))
    return camera_info_from_text(calibration, stamp_ns, frame_id)


def camera_info_from_text(camera: Calibration, stamp_ns: int, frame_id: str) -> Any:
    """sensor_msgs/CameraInfo of a camera that the user names."""
    roi = message("sensor_msgs/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return message(
        "sensor_msgs/CameraInfo",
        header=header(stamp_ns, frame_id),
        height=camera.height,
        width=camera.width,
        distortion_model=camera.distortion_model,
        d=np.array(camera.d, np.float64),
        k=np.array(camera.k, np.float64),
        r=np.array(camera.r, np.float64),
        p=np.array(camera.p, np.float64),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )


def point_cloud(records: Array, stamp_ns: int, frame_id: str) -> Any:
    """sensor_msgs/PointCloud2 of structured records (H, W); `objreg_ros.bridge.messages.layout` has layouts."""
    packed = np.ascontiguousarray(records)
    fields = [
        message("sensor_msgs/PointField", name=name, offset=offset, datatype=datatype, count=1)
        for name, offset, datatype in fields_of(packed.dtype)
    ]
    return message(
        "sensor_msgs/PointCloud2",
        header=header(stamp_ns, frame_id),
        height=packed.shape[0],
        width=packed.shape[1],
        fields=fields,
        is_bigendian=False,
        point_step=packed.itemsize,
        row_step=packed.itemsize * packed.shape[1],
        data=np.frombuffer(packed.tobytes(), np.uint8),
        is_dense=False,
    )


def pose(T_parent_child: Array) -> Any:
    """geometry_msgs/Pose."""
    x, y, z, w = (float(v) for v in quaternion_from_rotation(T_parent_child[:3, :3]))
    px, py, pz = (float(v) for v in T_parent_child[:3, 3])
    return message(
        "geometry_msgs/Pose",
        position=message("geometry_msgs/Point", x=px, y=py, z=pz),
        orientation=message("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w),
    )


def pose_stamped(T_parent_child: Array, stamp_ns: int, frame_id: str) -> Any:
    """geometry_msgs/PoseStamped: the pose of something in ``frame_id``."""
    return message("geometry_msgs/PoseStamped", header=header(stamp_ns, frame_id), pose=pose(T_parent_child))


def imu(acceleration: Sequence[float], angular_velocity: Sequence[float] | None, stamp_ns: int, frame_id: str) -> Any:
    """sensor_msgs/Imu without an orientation, in m/s^2 and rad/s; None for no gyroscope."""
    names = ("x", "y", "z")
    unknown = np.concatenate([[-1.0], np.zeros(8)])
    turn = (0.0, 0.0, 0.0) if angular_velocity is None else angular_velocity
    return message(
        "sensor_msgs/Imu",
        header=header(stamp_ns, frame_id),
        orientation=message("geometry_msgs/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=unknown,
        angular_velocity=message("geometry_msgs/Vector3", **dict(zip(names, map(float, turn), strict=True))),
        angular_velocity_covariance=unknown if angular_velocity is None else np.zeros(9),
        linear_acceleration=message("geometry_msgs/Vector3", **dict(zip(names, map(float, acceleration), strict=True))),
        linear_acceleration_covariance=np.zeros(9),
    )


def odometry(T_odom_body: Array, covariance: Array, stamp_ns: int, frame_id: str, child_frame_id: str) -> Any:
    """nav_msgs/Odometry with a (6, 6) covariance and no twist."""
    zero = message("geometry_msgs/Vector3", x=0.0, y=0.0, z=0.0)
    still = message("geometry_msgs/Twist", linear=zero, angular=zero)
    return message(
        "nav_msgs/Odometry",
        header=header(stamp_ns, frame_id),
        child_frame_id=child_frame_id,
        pose=message(
            "geometry_msgs/PoseWithCovariance",
            pose=pose(T_odom_body),
            covariance=np.ascontiguousarray(covariance, np.float64).ravel(),
        ),
        twist=message("geometry_msgs/TwistWithCovariance", twist=still, covariance=np.zeros(36)),
    )
