# SPDX-License-Identifier: Apache-2.0
"""Keyframes, sightings and closures as rows of the store, and back. Arrays become self-describing blobs.

Each row has a checksum of all its columns, and is not looked into before that is found right. What only a keyframe that
is read again needs, its view, context and points, is in rows of its own: the others are read without it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import closure_of, fields_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project, is_rigid
from objreg_ros.memory.checksum import Row, require_sealed, sealed
from objreg_ros.memory.descriptor import SIZE
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject

PLACES = {"position": 3, "camera": 3, "R_landmark_session": 9}  # doubles in the columns of a sighting


def pack(*arrays: Array | None) -> bytes:
    """Arrays, some of them None, as one blob: a line of JSON with dtypes and shapes, then the bytes."""
    header = [None if a is None else [a.dtype.str, list(a.shape)] for a in arrays]
    body = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays if a is not None)
    return json.dumps(header).encode() + b"\n" + body


def unpack(blob: bytes) -> tuple[Any, ...]:
    """The arrays of `pack`; ValueError if the blob is damaged."""
    try:
        header, body = blob.split(b"\n", 1)
        arrays: list[Array | None] = []
        offset = 0
        for entry in json.loads(header):
            if entry is None:
                arrays.append(None)
                continue
            dtype, shape = np.dtype(entry[0]), tuple(entry[1])
            array = np.frombuffer(body, dtype, int(np.prod(shape)), offset).reshape(shape)
            offset += array.nbytes
            arrays.append(array)
    except (ValueError, TypeError, IndexError, RecursionError, OverflowError) as error:
        raise ValueError(f"expected a packed blob, got {len(blob)} damaged bytes ({error})") from error
    return tuple(arrays)


def keyframe_row(keyframe: Keyframe) -> Row:
    """The columns of a keyframe, but for what it shows."""
    row = {
        "id": int(keyframe.keyframe_id),
        "robot": keyframe.robot,
        "origin": keyframe.origin,
        "session": int(keyframe.session),
        "stamp_ns": int(keyframe.stamp_ns),
        "frame_id": keyframe.frame_id,
        "travelled": _real(keyframe.travelled),
        "turned": _real(keyframe.turned),
        "T_odom_camera": _bytes(keyframe.T_odom_camera),
        "by_odometry": int(keyframe.by_odometry),
        "gravity": _bytes(keyframe.gravity),
        "gravity_confidence": _real(keyframe.gravity_confidence),
        "camera": camera_text(keyframe.view.intrinsics),
    }
    return sealed("keyframe", row)


def scene_row(keyframe: Keyframe) -> Row:
    """The columns of what a keyframe shows: its view and its context."""
    row = {
        "id": int(keyframe.keyframe_id),
        "view": pack(keyframe.view.xyz[..., 2], keyframe.view.grey),
        "context": pack(keyframe.context.xyz, keyframe.context.normals),
    }
    return sealed("scene", row)


def object_row(number: int, item: KeyObject, sighting: Sighting) -> Row:
    """The columns of one object of a keyframe, under its number in the store, but for its points."""
    cloud = item.cloud
    row = {
        "id": int(number),
        "keyframe": int(sighting.keyframe_id),
        "instance": int(cloud.instance),
        "landmark": int(sighting.landmark),
        "label": cloud.label,
        "score": _real(cloud.score),
        "extent": _real(sighting.extent),
        "sightings": int(item.sightings),
        "density": _real(cloud.density),
        "position": _bytes(sighting.position),
        "camera": _bytes(sighting.camera),
        "R_landmark_session": _bytes(sighting.R_landmark_session),
        "descriptor": sighting.descriptor.astype(np.float32).tobytes(),
    }
    return sealed("object", row)


def cloud_row(number: int, cloud: ObjectCloud) -> Row:
    """The columns of the points of an object, under its number in the store."""
    return sealed("cloud", {"id": int(number), "points": pack(cloud.xyz, cloud.normals, cloud.rgb, cloud.flags)})


def closure_row(number: int, closure: LoopClosure) -> Row:
    """The columns of a closure, under its number in the store: its sessions, and all its fields as JSON."""
    row = {
        "id": int(number),
        "from_session": closure.from_session,
        "to_session": closure.to_session,
        "fields": json.dumps(fields_of(closure)),
    }
    return sealed("closure", row)


def closure_from_row(row: Mapping[str, Any]) -> LoopClosure:
    """A closure from its row; its objects have the ids that they had when it was written. ValueError if damaged."""
    require_sealed(f"closure {row['id']}", "closure", row)
    try:
        return closure_of(json.loads(row["fields"]))
    except (TypeError, ValueError, RecursionError, AttributeError) as error:
        raise ValueError(f"closure {row['id']}: expected its fields as JSON, got others ({error})") from error


def require_keyframe(row: Mapping[str, Any]) -> None:
    """ValueError unless the row of a keyframe is as it was written."""
    require_sealed(f"keyframe {row['id']!r}", "keyframe", row)


def require_object(row: Mapping[str, Any]) -> None:
    """ValueError unless the row of an object is as it was written."""
    require_sealed(f"object {row['instance']!r} of keyframe {row['keyframe']!r}", "object", row)


def keyframe_from_rows(
    row: Mapping[str, Any],
    scenes: Sequence[Mapping[str, Any]],
    objects: Sequence[Mapping[str, Any]],
    clouds: Sequence[Mapping[str, Any]],
) -> Keyframe:
    """A keyframe from all its rows, ``clouds`` in the order of ``objects``. ValueError if anything of it is damaged."""
    if len(scenes) != 1 or len(clouds) != len(objects):
        raise ValueError(
            f"expected a view and {len(objects)} clouds, got {len(scenes)} and {len(clouds)}: it is damaged"
        )
    (scene,) = scenes
    require_keyframe(row)
    require_sealed("its view", "scene", scene)
    for item, cloud in zip(objects, clouds, strict=True):
        require_object(item)
        require_sealed(f"the points of object {item['instance']!r}", "cloud", cloud)
    camera = camera_of(row["camera"])
    depth, grey = _unpacked(scene, "view", 2)
    depth = np.where(depth < limits.LEAST_RANGE, np.float32(np.nan), depth)  # of a store of before that bound
    xyz = back_project(depth, camera.fx, camera.fy, camera.cx, camera.cy)
    context_xyz, context_normals = _unpacked(scene, "context", 2)
    return Keyframe(
        keyframe_id=row["id"],
        session=row["session"],
        stamp_ns=row["stamp_ns"],
        frame_id=row["frame_id"],
        objects=tuple(map(_object, objects, clouds)),
        context=Context(xyz=context_xyz, normals=context_normals),
        view=View(xyz=xyz, grey=grey, intrinsics=camera),
        gravity=_gravity(row),
        gravity_confidence=row["gravity_confidence"],
        T_odom_camera=pose_from_row(row),
        by_odometry=bool(row["by_odometry"]),
        travelled=row["travelled"],
        turned=row["turned"],
        robot=row["robot"],
        origin=row["origin"],
    )


def sighting_from_row(row: Mapping[str, Any], head: Mapping[str, Any]) -> Sighting:
    """A sighting from the row of its object and the head of its keyframe. ValueError if it is damaged."""
    require_object(row)
    try:
        return _sighting(row, head)
    except ValueError as error:
        raise ValueError(f"object {row['instance']} of keyframe {row['keyframe']}: {error}") from error


def _sighting(row: Mapping[str, Any], head: Mapping[str, Any]) -> Sighting:
    if not isinstance(row["label"], str):
        raise ValueError(f"label: expected text, got {row['label']!r}")
    places = b"".join(_bytes_of(row, name, 8 * count) for name, count in PLACES.items())  # looked at in one go
    numbers = _finite(", ".join(PLACES), np.frombuffer(places))
    descriptor = np.frombuffer(_bytes_of(row, "descriptor", 4 * SIZE), np.float32)
    return Sighting(
        keyframe_id=row["keyframe"],
        session=head["session"],
        stamp_ns=head["stamp_ns"],
        instance=row["instance"],
        label=row["label"],
        score=row["score"],
        extent=row["extent"],
        descriptor=_finite("descriptor", descriptor),
        position=numbers[:3],
        camera=numbers[3:6],
        travelled=head["travelled"],
        by_odometry=bool(head["by_odometry"]),
        robot=head["robot"],
        landmark=row["landmark"],
        R_landmark_session=numbers[6:].reshape(3, 3),
    )


def _object(row: Mapping[str, Any], cloud: Mapping[str, Any]) -> KeyObject:
    xyz, normals, rgb, flags = _unpacked(cloud, "points", 4)
    made = ObjectCloud(
        label=row["label"],
        score=row["score"],
        instance=row["instance"],
        xyz=xyz,
        normals=normals,
        rgb=rgb,
        flags=flags,
        density=row["density"],
    )
    return KeyObject(cloud=made, sightings=row["sightings"])


def _unpacked(row: Mapping[str, Any], name: str, arrays: int) -> tuple[Any, ...]:
    found = unpack(row[name])
    if len(found) != arrays:
        raise ValueError(f"{name}: expected {arrays} arrays, got {len(found)}")
    return found


def _real(number: float) -> float:
    """As the database gives it back: a double, and no -0.0."""
    return float(number) + 0.0


def _bytes(array: Array | None) -> bytes | None:
    return None if array is None else np.ascontiguousarray(array, float).tobytes()


def _bytes_of(row: Mapping[str, Any], name: str, size: int) -> bytes:
    blob = row[name]
    if not isinstance(blob, bytes) or len(blob) != size:
        got = f"{len(blob)} bytes" if isinstance(blob, bytes) else repr(blob)
        raise ValueError(f"{name}: expected {size} bytes, got {got}")
    return blob


def _finite(name: str, numbers: Array) -> Array:
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name}: expected finite numbers, got {numbers.tolist()}")
    return numbers


def camera_text(camera: Intrinsics) -> str:
    """A camera as JSON."""
    return json.dumps({name: getattr(camera, name) for name in Intrinsics.__slots__})  # type: ignore[attr-defined]


def camera_of(text: str) -> Intrinsics:
    """The camera of `camera_text`. ValueError if it is none."""
    try:
        return Intrinsics(**json.loads(text))
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"camera: expected fx fy cx cy width height as JSON, got {text!r} ({error})") from error


def gravity_of(numbers: Array) -> Array:
    """The direction (3,) of so many numbers. ValueError if they are none."""
    gravity = _finite("gravity", numbers)
    if gravity.shape != (3,) or abs(np.linalg.norm(gravity) - 1.0) > 1e-4:
        raise ValueError(f"gravity: expected a direction of length 1, got {gravity.tolist()}")
    return gravity


def pose_of(numbers: Array) -> Array:
    """The pose (4, 4) of a camera in the world, of 16 numbers. ValueError if they are none."""
    if numbers.shape != (16,) or not is_rigid(T := numbers.reshape(4, 4), 1e-4):
        raise ValueError(f"T_odom_camera: expected a rigid motion, got {numbers.tolist()}")
    return T


def pose_from_row(row: Mapping[str, Any]) -> Array | None:
    """``T_odom_camera (4, 4)`` from the row of a keyframe; None where it has none. ValueError if it is damaged."""
    return None if row["T_odom_camera"] is None else pose_of(np.frombuffer(_bytes_of(row, "T_odom_camera", 128)))


def _gravity(row: Mapping[str, Any]) -> Array | None:
    return None if row["gravity"] is None else gravity_of(np.frombuffer(_bytes_of(row, "gravity", 24)))
