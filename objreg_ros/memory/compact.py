# SPDX-License-Identifier: Apache-2.0
"""A keyframe as few bytes, to be sent: quantised below the noise (`keyframes/quantised.py`), and compressed.

The order of points stays. The store's own numbers, the id and the landmarks, do not travel.

The body (see `envelope`) ends with columns of whole numbers. A column is a byte with its width, and the bytes of its
numbers, the lowest of all numbers first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import SURROGATE, Array
from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.geometry import back_project
from objreg_ros.keyframes import quantised
from objreg_ros.keyframes.columns import Columns, column
from objreg_ros.keyframes.fewer_points import in_front, thinned
from objreg_ros.keyframes.own_size import sized_keyframe
from objreg_ros.memory.codec import camera_of, camera_text, gravity_of, pose_of
from objreg_ros.memory.envelope import Head, by_lzma
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject

KEYFRAME = by_lzma(b"OKF", "a packed keyframe", limits.MOST_PACKED_KEYFRAME, limits.MOST_UNPACKED_KEYFRAME)
MOST_BYTES = 100_000  # of a packed keyframe, for whose sake objects are thinned
POINT_BYTES = 3.0  # what one point of an object less saves, about
SPARE_BYTES = 500  # that thinning leaves below the bound
ROUNDS = 4  # of thinning
MOST_WHOLE = 2**63 - 1


def pack_keyframe(keyframe: Keyframe, most_bytes: int = MOST_BYTES) -> bytes:
    """A keyframe as bytes for `unpack_keyframe`, without its id.

    What would take more than ``most_bytes`` has its objects thinned evenly, to `fewer_points.LEAST_POINTS` each at
    least. It stays larger where the view and the context alone are. ValueError if it is beyond what is read.
    """
    kept = in_front(keyframe)
    packed = _packed(kept)
    for _ in range(ROUNDS):
        if len(packed) <= most_bytes:
            break
        kept = thinned(kept, (len(packed) - most_bytes + SPARE_BYTES) / POINT_BYTES)
        packed = _packed(kept)
    return packed


def unpack_keyframe(packed: bytes) -> Keyframe:
    """The keyframe of `pack_keyframe`, with id 0, at its `own_size`.

    ValueError if it is damaged, of another format, or too large.
    """
    return sized_keyframe(KEYFRAME.unpack(packed, _read))


def _read(head: Head, body: bytes) -> Keyframe:
    columns = Columns(body)
    keyframe = _keyframe(head, columns)
    columns.require_end()
    return keyframe


def _packed(keyframe: Keyframe) -> bytes:
    columns = (*_view_columns(keyframe.view), *_context_columns(keyframe), *_object_columns(keyframe.objects))
    return KEYFRAME.pack(_head(keyframe), b"".join(columns))


def _head(keyframe: Keyframe) -> dict[str, Any]:
    return {
        "session": int(keyframe.session),
        "stamp_ns": int(keyframe.stamp_ns),
        "frame_id": keyframe.frame_id,
        "travelled": float(keyframe.travelled),
        "turned": float(keyframe.turned),
        "T_odom_camera": None if keyframe.T_odom_camera is None else keyframe.T_odom_camera.ravel().tolist(),
        "by_odometry": int(keyframe.by_odometry),
        "gravity": None if keyframe.gravity is None else keyframe.gravity.tolist(),
        "gravity_confidence": float(keyframe.gravity_confidence),
        "camera": camera_text(keyframe.view.intrinsics),
        "grey": int(keyframe.view.grey is not None),
        "context": len(keyframe.context),
        "objects": [_object_head(item) for item in keyframe.objects],
    }


def _object_head(item: KeyObject) -> dict[str, Any]:
    cloud = item.cloud
    return {
        "label": cloud.label,
        "score": float(cloud.score),
        "instance": int(cloud.instance),
        "sightings": int(item.sightings),
        "density": float(cloud.density),
        "points": len(cloud),
        "step_um": quantised.step_um(cloud.xyz),
        "rgb": int(cloud.rgb is not None),
    }


def _keyframe(head: Head, columns: Columns) -> Keyframe:
    view = _view(head, columns)
    xyz, normals = _oriented(columns, whole(head, "context", 0, limits.MOST_VIEW_PIXELS), quantised.CONTEXT_STEP_UM)
    return Keyframe(
        keyframe_id=0,
        session=whole(head, "session", 0, MOST_WHOLE),
        stamp_ns=whole(head, "stamp_ns", limits.LEAST_STAMP_NS, limits.MOST_STAMP_NS),
        frame_id=text(head, "frame_id"),
        objects=_objects(head["objects"], columns),
        context=Context(xyz=xyz, normals=normals),
        view=view,
        gravity=None if head["gravity"] is None else gravity_of(np.array(head["gravity"], float)),
        gravity_confidence=real(head, "gravity_confidence", 1.0),
        T_odom_camera=_pose(head),
        by_odometry=bool(whole(head, "by_odometry", 0, 1)),
        travelled=real(head, "travelled", limits.MOST_DISTANCE),
        turned=real(head, "turned", limits.MOST_DISTANCE),
    )


def _pose(head: Head) -> Array | None:
    if head["T_odom_camera"] is None:
        return None
    T = pose_of(np.array(head["T_odom_camera"], float))
    if (farthest := float(np.abs(T[:3, 3]).max())) > limits.MOST_DISTANCE:
        raise ValueError(f"T_odom_camera: expected a camera within {limits.MOST_DISTANCE:g} m, got {farthest:g} m")
    return T


def _view_columns(view: View) -> list[bytes]:
    depth, reach = view.xyz[..., 2], np.abs(view.xyz).max(axis=-1)
    known = (depth >= limits.LEAST_RANGE) & (reach <= limits.MOST_RANGE * (1.0 - quantised.DEPTH_STEP))
    steps = quantised.depth_steps(depth[known])
    columns = [column(np.diff(known.ravel().astype(np.int64), prepend=0)), column(np.diff(steps, prepend=0))]
    if view.grey is not None:
        columns.append(column(np.diff(np.diff(quantised.grey_steps(view.grey), axis=1, prepend=0), axis=0, prepend=0)))
    return columns


def _view(head: Head, columns: Columns) -> View:
    camera = camera_of(head["camera"])
    shape = camera.height, camera.width
    pixels = within("pixels of a view", shape[0] * shape[1], limits.MOST_VIEW_PIXELS)
    known = np.cumsum(columns.next_column(pixels)) > 0
    depth = np.full(pixels, np.nan, np.float32)
    depth[known] = np.maximum(quantised.depth_of(np.cumsum(columns.next_column(int(known.sum())))), limits.LEAST_RANGE)
    grey = None
    if whole(head, "grey", 0, 1):
        grey = quantised.grey_of(np.cumsum(np.cumsum(columns.next_column(pixels).reshape(shape), axis=0), axis=1))
    xyz = back_project(depth.reshape(shape), camera.fx, camera.fy, camera.cx, camera.cy)
    return View(xyz=xyz, grey=grey, intrinsics=camera)


def _context_columns(keyframe: Keyframe) -> list[bytes]:
    context = keyframe.context
    return _oriented_columns(quantised.point_steps(context.xyz, quantised.CONTEXT_STEP_UM), context.normals)


def _object_columns(objects: Sequence[KeyObject]) -> list[bytes]:
    """All objects in one, so that similar values are neighbours."""
    if not objects:
        return []
    clouds = [item.cloud for item in objects]
    steps = [quantised.point_steps(cloud.xyz, quantised.step_um(cloud.xyz)) for cloud in clouds]
    columns = _oriented_columns(np.concatenate(steps), np.concatenate([cloud.normals for cloud in clouds]))
    columns.append(column(np.concatenate([cloud.flags for cloud in clouds])))
    return columns + [column(quantised.colour_steps(cloud.rgb).T) for cloud in clouds if cloud.rgb is not None]


def _objects(heads: Sequence[Head], columns: Columns) -> tuple[KeyObject, ...]:
    within("objects", len(heads), limits.MOST_OBJECTS)
    counts = [whole(head, "points", 1, limits.MOST_OBJECT_POINTS) for head in heads]
    total = within("points of objects", sum(counts), limits.MOST_OBJECT_POINTS)
    if not heads:
        return ()
    steps_um = np.repeat([whole(head, "step_um", 1, 10 * quantised.MOST_STEP_UM) for head in heads], counts)
    xyz, normals = _oriented(columns, total, steps_um[:, None])
    if (nearest := float(xyz[:, 2].min())) < limits.LEAST_RANGE:
        raise ValueError(f"expected objects {limits.LEAST_RANGE} m before the camera or farther, got {nearest:g} m")
    flags = columns.next_column(total).astype(np.uint16)
    ends = np.cumsum(counts)[:-1]
    parts = zip(heads, *(np.split(array, ends) for array in (xyz, normals, flags)), strict=True)
    return tuple(_object(head, columns, xyz=part[0], normals=part[1], flags=part[2]) for head, *part in parts)


def _object(head: Head, columns: Columns, *, xyz: Array, normals: Array, flags: Array) -> KeyObject:
    coloured = whole(head, "rgb", 0, 1)
    cloud = ObjectCloud(
        label=text(head, "label"),
        score=real(head, "score", 1.0),
        instance=whole(head, "instance", 0, MOST_WHOLE),
        xyz=xyz,
        normals=normals,
        rgb=quantised.rgb_of(columns.next_column(3 * len(xyz)).reshape(3, -1).T) if coloured else None,
        flags=flags,
        density=real(head, "density", limits.MOST_DENSITY),
    )
    return KeyObject(cloud=cloud, sightings=whole(head, "sightings", 1, MOST_WHOLE))


def _oriented_columns(steps: Array, normals: Array) -> list[bytes]:
    return [column(np.diff(steps, axis=0, prepend=0).T), column(quantised.normal_steps(normals).T)]


def _oriented(columns: Columns, count: int, each_um: Array | int) -> tuple[Array, Array]:
    """Points (N, 3) and normals (N, 3), both float32."""
    steps = np.cumsum(columns.next_column(3 * count).reshape(3, count), axis=1).T
    return quantised.points_of(steps, each_um), quantised.normals_of(columns.next_column(2 * count).reshape(2, count).T)


def within(name: str, number: Any, most: int, least: int = 0) -> int:
    """A whole number within bounds; ValueError, with its ``name``, for anything else."""
    if type(number) is not int or not least <= number <= most:
        raise ValueError(f"expected {name} of {least} to {most}, got {number!r}")
    return number


def whole(head: Head, name: str, least: int, most: int) -> int:
    """`within` of what a head has under a name; KeyError if it has nothing."""
    return within(name, head[name], most, least)


def real(head: Head, name: str, most: float) -> float:
    """A number of 0 to ``most`` of a head; KeyError if it has nothing, ValueError for anything else."""
    number = head[name]
    if type(number) not in (int, float) or not 0.0 <= number <= most:
        raise ValueError(f"{name}: expected a number of 0 to {most:g}, got {number!r}")
    return float(number)


def text(head: Head, name: str) -> str:
    """A name of a head; KeyError if it has nothing, ValueError for anything else."""
    said = head[name]
    if not isinstance(said, str) or len(said) > limits.MOST_NAME or SURROGATE.search(said):
        raise ValueError(f"{name}: expected at most {limits.MOST_NAME} characters, got {ascii(said)[:100]}")
    return said
