# SPDX-License-Identifier: Apache-2.0
"""Messages to the data types of data.py. Only this module and `closures_msg` know the fields of incoming messages.

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
from objreg_ros.bridge.messages.layout import (
    SUPPORT_ID,
    SUPPORT_LABEL,
    SURPLUS,
    UNNAMED_ID,
    columns,
    table,
    whole_numbers,
)
from objreg_ros.bridge.messages.pictures import colour_pixels, depth_metres, unpack_rgb
from objreg_ros.data import (
    SURROGATE,
    UNNAMED,
    ColourImage,
    DepthImage,
    Detections,
    FeltGravity,
    Frame,
    ImuSample,
    Intrinsics,
    LoopClosure,
    ObjectCloud,
    Odometry,
    PointCloud,
    View,
)
from objreg_ros.geometry import interpolate, pose, rotation_from_quaternion
from objreg_ros.plausibility.pinhole import differ, likelier

Array = NDArray[Any]

UNIT = 0.01  # how far from 1 the length of a quaternion may be that was meant as one
COLUMNS = {"p": 4, "k": 3}  # of the matrices of a camera_info
MOMENT = re.compile(r"(?P<name>.*)@(?P<seconds>-?[0-9]{1,10})\.(?P<nanoseconds>[0-9]{9})", re.DOTALL)


def stamp_ns(message: Any) -> int:
    """The time of a message with a header, of a Header, of a Time or of a value, in integer nanoseconds.

    ValueError for one that a ROS 2 message cannot carry: seconds of more than 32 bits, a second of nanoseconds.
    """
    if hasattr(message, "stamp_ns"):
        return int(message.stamp_ns)
    stamp = getattr(message, "header", message)
    stamp = getattr(stamp, "stamp", stamp)
    if not 0 <= stamp.nanosec < limits.NANOSECONDS:
        raise ValueError(f"stamp: expected nanoseconds below {limits.NANOSECONDS}, got {stamp.nanosec}")
    return _stamp_within_limits(int(stamp.sec) * limits.NANOSECONDS + int(stamp.nanosec))


def _stamp_within_limits(stamp_ns: int) -> int:
    if not limits.LEAST_STAMP_NS <= stamp_ns <= limits.MOST_STAMP_NS:
        raise ValueError(f"stamp: expected seconds of 32 bits, got {stamp_ns // limits.NANOSECONDS}")
    return stamp_ns


def bounded(text: str, of: str, most: int = limits.MOST_NAME) -> str:
    """The text; ValueError where it is longer than ``most`` characters."""
    if len(text) > most:
        raise ValueError(f"{of}: expected at most {most} characters, got {len(text)}: {text[:40]!r}…")
    return text


def frame_id(message: Any) -> str:
    """The frame of a message with a header, or of a value."""
    return str(getattr(message, "header", message).frame_id)


def when_and_where(message: Any) -> dict[str, Any]:
    """``stamp_ns`` and ``frame_id`` of a message with a header, as arguments of a data type."""
    return {"stamp_ns": stamp_ns(message), "frame_id": bounded(message.header.frame_id, "frame_id")}


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


def intrinsics(message: Any) -> Intrinsics:
    """The pinhole camera of a CameraInfo, with its binning and region of interest applied.

    It is the projection matrix P, by which rectified and registered pictures are made (image_geometry's
    PinholeCameraModel), and K where P is left at zeros, or cannot be that of the picture as K can. ValueError
    for a camera that is not calibrated (ROS drivers say so with zeros in both).
    """
    camera = _windowed(_calibrated(message), message)
    other = disagreeing_k(message)
    return camera if other is None else likelier(camera, other)


def disagreeing_k(message: Any) -> Intrinsics | None:
    """The camera of K where P is another one that it cannot be; None where the two agree, or may differ.

    They may where there is something to rectify (D, R), as far as P can be the camera of the picture too.
    """
    K, P, R = _camera_matrix(message, "k"), _camera_matrix(message, "p"), _numbers(message, "r")
    if K[0, 0] == 0 or P[0, 0] == 0 or np.array_equal(K, P[:, :3]):
        return None
    try:
        k, p = pinhole(message, "k"), pinhole(message, "p")
    except ValueError:
        return None
    is_turned = R.any() and not np.allclose(R, np.eye(3).ravel(), atol=1e-6)
    if np.any(_numbers(message, "d")) or is_turned:
        return k if likelier(p, k) is k else None
    return k if differ(p, k) else None


def _numbers(message: Any, name: str) -> Array:
    values = getattr(message, name) if hasattr(message, name) else getattr(message, name.upper(), ())  # as in ROS 1
    return np.asarray(values, np.float64).ravel()


def pinhole(message: Any, name: str) -> Intrinsics:
    """The pinhole camera of one matrix of a CameraInfo, ``k`` or ``p``, with binning and region of interest applied.

    ValueError where that one is not calibrated.
    """
    return _windowed(_usable(message, name), message)


def _windowed(matrix: Array, message: Any) -> Intrinsics:
    roi, (bin_x, bin_y) = message.roi, (max(1, int(b)) for b in (message.binning_x, message.binning_y))
    width, height = int(roi.width) or int(message.width), int(roi.height) or int(message.height)
    return Intrinsics(
        fx=float(matrix[0, 0]) / bin_x,
        fy=float(matrix[1, 1]) / bin_y,
        cx=(float(matrix[0, 2]) - int(roi.x_offset)) / bin_x,
        cy=(float(matrix[1, 2]) - int(roi.y_offset)) / bin_y,
        width=width // bin_x,
        height=height // bin_y,
    )


def is_calibrated(message: Any) -> bool:
    """Whether a CameraInfo says anything of its camera: drivers leave K and P at zeros until somebody calibrated it."""
    return any(_camera_matrix(message, name).flat[0] != 0 for name in "pk")


def camera_of_cloud(
    camera_info: Any, cloud: PointCloud, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE
) -> Intrinsics | None:
    """The camera that a cloud is organised or projected with; None without a ``camera_info``.

    None too for one that is not calibrated where the cloud is organised, since that needs none; else ValueError.
    """
    if camera_info is None or (cloud.organised and not is_calibrated(camera_info)):
        return None
    camera = intrinsics(camera_info)
    if camera.width * camera.height > most_pixels:
        raise ValueError(f"camera_info: expected at most {most_pixels} pixels, got {camera.width} × {camera.height}")
    return camera


def _calibrated(message: Any) -> Array:
    """P (3, 4) or, where it says nothing, K (3, 3), in pixels of the whole picture; ValueError if neither is usable."""
    return _usable(message, "p" if _camera_matrix(message, "p").flat[0] != 0 else "k")


def _usable(message: Any, name: str) -> Array:
    matrix = _camera_matrix(message, name)
    if not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        got = matrix.ravel().tolist()
        raise ValueError(f"camera_info: expected a calibrated {name.upper()} with focal lengths above 0, got {got}")
    return matrix


def _camera_matrix(message: Any, name: str) -> Array:
    values = getattr(message, name) if hasattr(message, name) else getattr(message, name.upper())  # as in ROS 1
    return np.asarray(values, np.float64).reshape(3, COLUMNS[name])


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


def odometry(message: Any) -> Odometry:
    """An Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped; ValueError without a rotation."""
    return Odometry(
        T_odom_body=motion(message),
        child_frame_id=bounded(getattr(message, "child_frame_id", ""), "child_frame_id"),
        **when_and_where(message),
    )


def pose_at(moment_ns: int, words: Sequence[Odometry]) -> Array:
    """``T_odom_body (4, 4)`` at a time, between the two odometry samples that enclose it; of one sample its own.

    The nearer one's where their frames differ.
    """
    first, last = words[0], words[-1]
    if first.stamp_ns == last.stamp_ns:
        return first.T_odom_body
    if first.frame_id != last.frame_id:
        return (first if moment_ns - first.stamp_ns <= last.stamp_ns - moment_ns else last).T_odom_body
    share = (moment_ns - first.stamp_ns) / (last.stamp_ns - first.stamp_ns)
    return interpolate(first.T_odom_body, last.T_odom_body, min(1.0, max(0.0, share)))


def level_gravity(moment_ns: int, words: Sequence[Odometry] | None, T_body_camera: Array | None = None) -> Array | None:
    """The direction of gravity (3,) in the camera frame by an odometry whose frame is level with z up; else None.

    ``words`` are the samples of `pose_at`. ``T_body_camera`` is the pose of the camera on the body of the odometry;
    the identity if None.
    """
    if not words:
        return None
    T_level_body = pose_at(moment_ns, words)
    T_level_camera = T_level_body if T_body_camera is None else T_level_body @ T_body_camera
    return -T_level_camera[2, :3]


def imu(message: Any) -> ImuSample:
    """An Imu; a field whose covariance begins with -1 is not measured (REP-145).

    Nor is an orientation that is no unit quaternion, or none but what an empty message holds. ValueError where what is
    measured is not finite.
    """
    return ImuSample(
        acceleration=_measured(message.linear_acceleration, "xyz", message.linear_acceleration_covariance),
        angular_velocity=_measured(message.angular_velocity, "xyz", message.angular_velocity_covariance),
        orientation=_orientation(message),
        orientation_sigma_deg=_tilt_deg(message.orientation_covariance),
        **when_and_where(message),
    )


def _measured(vector: Any, names: str, covariance: Any) -> Array | None:
    return None if covariance[0] < 0 else np.array([getattr(vector, name) for name in names], float)


def _orientation(message: Any) -> Array | None:
    xyzw = _measured(message.orientation, "xyzw", message.orientation_covariance)
    if xyzw is None or abs(float(np.linalg.norm(xyzw)) - 1.0) >= UNIT:
        return None
    is_empty = xyzw[3] == 1.0 and not np.any(message.orientation_covariance)
    return None if is_empty else xyzw / np.linalg.norm(xyzw)


def _tilt_deg(covariance: Any) -> float:
    """The standard deviation of roll and pitch, the larger one; 0 where it is not known."""
    variance = max(float(covariance[0]), float(covariance[4]))
    return float(np.degrees(np.sqrt(variance))) if 0.0 < variance < np.inf else 0.0


def gravity_at(moment_ns: int, words: Sequence[FeltGravity]) -> FeltGravity:
    """The gravity at a time, between the two samples of a filter that enclose it; of one sample its own.

    Its confidence is the lower of the two. It is the nearer sample's where their frames differ.
    """
    first, last = words[0], words[-1]
    if first.stamp_ns == last.stamp_ns:
        return first
    share = min(1.0, max(0.0, (moment_ns - first.stamp_ns) / (last.stamp_ns - first.stamp_ns)))
    mean = (1.0 - share) * first.gravity + share * last.gravity
    length = float(np.linalg.norm(mean))
    if first.frame_id != last.frame_id or length < 0.5:
        return first if share <= 0.5 else last
    return FeltGravity(
        gravity=mean / length,
        gravity_sigma_deg=max(first.gravity_sigma_deg, last.gravity_sigma_deg),
        stamp_ns=moment_ns,
        frame_id=first.frame_id,
    )


def motion(message: Any) -> Array:
    """The (4, 4) motion of a message with a ``transform`` or a ``pose``, with covariance or without."""
    if hasattr(message, "transform"):
        where, turn = message.transform.translation, message.transform.rotation
    else:
        body = getattr(message.pose, "pose", message.pose)
        where, turn = body.position, body.orientation
    R = rotation_from_quaternion(np.array([turn.x, turn.y, turn.z, turn.w], float))
    return pose(R, np.array([where.x, where.y, where.z], float))


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
    return found["name"], _stamp_within_limits(seconds * limits.NANOSECONDS + nanoseconds)


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
    xyxy, score, label, told_hw = _rows_of_table(message, names)
    order = np.argsort(-score, kind="stable")
    found = Detections(
        xyxy=np.ascontiguousarray(xyxy[order]),
        score=np.ascontiguousarray(score[order]),
        label=tuple(label[i] for i in order),
        image_hw=told_hw or image_hw,
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
    odometry_words: Sequence[Odometry] | None = None,
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
        T_odom_camera=_camera_pose(stamps[0], odometry_words, T_body_camera),
        **when_and_where(objects_message),
    )


def followed(word: Frame, odometry_words: Sequence[Odometry] | None, T_body_camera: Array | None = None) -> Frame:
    """The segmenter's own frame, with the odometry around it as in `frame`."""
    return replace(word, T_odom_camera=_camera_pose(word.stamp_ns, odometry_words, T_body_camera))


def _camera_pose(moment_ns: int, words: Sequence[Odometry] | None, T_body_camera: Array | None) -> Array | None:
    T_odom_body = pose_at(moment_ns, words) if words else None
    return T_odom_body if T_odom_body is None or T_body_camera is None else T_odom_body @ T_body_camera
