# SPDX-License-Identifier: Apache-2.0
"""A small furnished room of boxes, cast by rays: keyframes whose true poses are known to the last digit."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotate, transform
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)

# World: x forward, y left, z up; (label, low corner, high corner). The first one is the room, seen from inside.
ROOM = (
    ("room", (-1.0, -2.0, 0.0), (3.2, 2.2, 2.6)),
    ("table", (1.2, -0.9, 0.68), (2.4, 0.9, 0.72)),
    ("book", (1.5, -0.5, 0.72), (1.72, -0.2, 0.79)),
    ("cup", (1.6, 0.25, 0.72), (1.69, 0.34, 0.84)),
    ("bottle", (1.9, 0.5, 0.72), (1.98, 0.58, 1.0)),
    ("keyboard", (1.45, -0.1, 0.72), (1.6, 0.15, 0.75)),
    ("shelf", (2.7, -1.6, 0.0), (3.2, -0.8, 1.7)),
    ("cupboard", (2.5, 1.5, 0.0), (3.2, 2.2, 1.1)),
    ("stool", (0.9, 1.0, 0.0), (1.25, 1.4, 0.5)),
)
BACKGROUND = ("room", "table", "shelf", "cupboard", "stool")


def look_at(eye: tuple[float, float, float], at: tuple[float, float, float]) -> Array:
    """T_world_camera of an upright camera at ``eye`` that looks at ``at``."""
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return pose(np.stack([right, np.cross(forward, right), forward], axis=1), np.asarray(eye, float))


def cast(T_world_camera: Array, boxes: tuple = ROOM) -> tuple[Array, Array, Array]:
    """Depth (h, w), which box (h, w) and world normal (h, w, 3) of each pixel, by the slab test."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    directions, eye = rotate(T_world_camera, rays), T_world_camera[:3, 3]
    depth, owner = np.full(u.shape, np.inf), np.full(u.shape, -1)
    normal = np.zeros((*u.shape, 3))
    for k, (label, low, high) in enumerate(boxes):
        with np.errstate(divide="ignore"):
            a, b = (np.array(low) - eye) / directions, (np.array(high) - eye) / directions
        enter, leave = np.minimum(a, b), np.maximum(a, b)
        t = leave.min(axis=-1) if label == "room" else enter.max(axis=-1)
        axis = leave.argmin(axis=-1) if label == "room" else enter.argmax(axis=-1)
        hit = (t > 0) & (t < depth) & ((label == "room") | (enter.max(axis=-1) < leave.min(axis=-1)))
        depth[hit], owner[hit] = t[hit], k
        sign = -np.sign(np.take_along_axis(directions, axis[..., None], axis=-1))
        normal[hit] = (np.eye(3)[axis] * sign)[hit]
    return depth, owner, normal


def shade(points: Array) -> Array:
    """A grey pattern fixed to the world, fine enough to distinguish places."""
    x, y, z = np.moveaxis(points, -1, 0)
    waves = np.sin(23.0 * x + 3.0 * z) + np.sin(17.0 * y - 5.0 * x) + np.sin(19.0 * z + 11.0 * y) + np.sin(41.0 * x * y)
    return np.asarray(np.clip(128.0 + 28.0 * waves, 0, 255), np.uint8)


def keyframe(
    T_world_camera: Array,
    boxes: tuple = ROOM,
    noise: float = 0.002,
    seed: int = 0,
    gravity: bool = True,
    grey: bool = True,
) -> Keyframe:
    """What a camera at ``T_world_camera`` keeps of the room, with depth noise of ``noise * z^2`` m."""
    depth, owner, normal = cast(T_world_camera, boxes)
    clean = _points(depth)
    xyz = _points(depth + np.random.default_rng(seed).normal(0.0, noise, depth.shape) * depth**2).astype(np.float32)
    normals = rotate(inverse(T_world_camera), normal).astype(np.float32)
    image = shade(transform(T_world_camera, clean)) if grey else None
    names = [label for label, _, _ in boxes]
    clouds = [
        _cloud(names[k], xyz[owner == k], normals[owner == k], k)
        for k in range(len(boxes))
        if names[k] not in BACKGROUND
    ]
    thinned = (slice(None, None, 2), slice(None, None, 2))
    return Keyframe(
        keyframe_id=0,
        session=0,
        stamp_ns=0,
        frame_id="camera",
        objects=tuple(KeyObject(cloud=cloud) for cloud in clouds if len(cloud) >= 12),
        context=Context(xyz=xyz[thinned].reshape(-1, 3), normals=normals[thinned].reshape(-1, 3)),
        view=View(xyz=xyz, grey=image, intrinsics=CAMERA),
        gravity=T_world_camera[:3, :3].T @ np.array([0.0, 0.0, -1.0]) if gravity else None,
        gravity_confidence=1.0 if gravity else 0.0,
        T_odom_camera=None,
    )


def _points(depth: Array) -> Array:
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    return np.stack([(u - CAMERA.cx) / CAMERA.fx * depth, (v - CAMERA.cy) / CAMERA.fy * depth, depth], axis=-1)


def _cloud(label: str, xyz: Array, normals: Array, number: int) -> ObjectCloud:
    return ObjectCloud(
        label=label,
        score=0.9,
        instance=number,
        xyz=xyz,
        normals=normals,
        rgb=None,
        flags=np.zeros(len(xyz), np.uint16),
        density=1e4,
    )


def seen_from(angle_deg: float, distance: float = 1.9, height: float = 1.5) -> Array:
    """A camera that looks at the table's middle from ``angle_deg`` to the left of straight ahead."""
    angle = np.radians(angle_deg)
    at = (1.75, 0.05, 0.75)
    return look_at((at[0] - distance * np.cos(angle), at[1] + distance * np.sin(angle), height), at)
