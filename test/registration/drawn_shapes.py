# SPDX-License-Identifier: Apache-2.0
"""Things on a table, cast by rays from any side: keyframes with fine object clouds whose poses are known."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotate, transform
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject
from registration.rooms import look_at

CAMERA = Intrinsics(fx=262.5, fy=262.5, cx=159.5, cy=119.5, width=320, height=240)
STEP = 2  # pixels of the camera for one of the view
Box = tuple[tuple[float, float, float], tuple[float, float, float]]

BOX: tuple[Box, ...] = (((-0.10, -0.04, 0.0), (0.10, 0.04, 0.25)),)
ELL: tuple[Box, ...] = (((-0.12, -0.05, 0.0), (0.12, 0.03, 0.10)), ((-0.12, 0.03, 0.0), (-0.04, 0.15, 0.18)))
CAN = 0.05  # m, a radius; it is 0.15 m high


def from_side(angle_deg: float, distance: float = 0.9) -> Array:
    """A camera that looks down at what stands in the middle."""
    a = np.radians(angle_deg)
    return look_at((distance * np.cos(a), distance * np.sin(a), 0.65), (0.0, 0.0, 0.08))


def cast_boxes(eye: Array, rays: Array, boxes: tuple[Box, ...]) -> tuple[Array, Array]:
    """Depth along the rays (h, w), infinite where none is hit, and normals (h, w, 3)."""
    depth, normal = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape)
    for low, high in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (np.array(low) - eye) / rays, (np.array(high) - eye) / rays
        enter, leave = np.minimum(a, b), np.maximum(a, b)
        t, axis = enter.max(axis=-1), enter.argmax(axis=-1)
        hit = (t > 0) & (t < leave.min(axis=-1)) & (t < depth)
        depth[hit] = t[hit]
        sign = -np.sign(np.take_along_axis(rays, axis[..., None], axis=-1))
        normal[hit] = (np.eye(3)[axis] * sign)[hit]
    return depth, normal


def cast_can(eye: Array, rays: Array, centre: tuple[float, float]) -> tuple[Array, Array]:
    """The same of an upright can, its wall and lid."""
    x, y = eye[0] - centre[0], eye[1] - centre[1]
    a = rays[..., 0] ** 2 + rays[..., 1] ** 2
    b = x * rays[..., 0] + y * rays[..., 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        wall = (-b - np.sqrt(b * b - a * (x * x + y * y - CAN**2))) / a
        lid = (0.15 - eye[2]) / rays[..., 2]
    at = eye + wall[..., None] * rays
    on_wall = np.isfinite(wall) & (wall > 0) & (at[..., 2] > 0) & (at[..., 2] < 0.15)
    top = eye + lid[..., None] * rays
    on_lid = (lid > 0) & (np.hypot(top[..., 0] - centre[0], top[..., 1] - centre[1]) < CAN)
    normal = np.zeros(rays.shape)
    normal[on_wall, :2] = (at[on_wall, :2] - centre) / CAN
    normal[on_lid] = (0.0, 0.0, 1.0)
    return np.where(on_lid, lid, np.where(on_wall, wall, np.inf)), normal


def keyframe(
    T_world_camera: Array, things: dict[str, tuple[Box, ...] | tuple[float, float]], noise: float = 0.001, seed: int = 0
) -> Keyframe:
    """What a camera keeps of a table with things on it: boxes, or a can by its middle."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    world, eye = rotate(T_world_camera, rays), T_world_camera[:3, 3]
    depth = np.where(world[..., 2] < 0, -eye[2] / np.minimum(world[..., 2], -1e-9), np.inf)
    normal, owner = np.broadcast_to((0.0, 0.0, 1.0), rays.shape).copy(), np.full(depth.shape, -1)
    for k, thing in enumerate(things.values()):
        is_can = isinstance(thing[0], float)
        near, facing = cast_can(eye, world, thing) if is_can else cast_boxes(eye, world, thing)  # type: ignore[arg-type]
        hit = near < depth
        depth[hit], normal[hit], owner[hit] = near[hit], facing[hit], k
    depth = depth + np.random.default_rng(seed).normal(0.0, noise, depth.shape)
    xyz = np.where(np.isfinite(depth)[..., None] & (depth[..., None] < 4.0), rays * depth[..., None], np.nan)
    xyz = xyz.astype(np.float32)
    normals = rotate(inverse(T_world_camera), normal).astype(np.float32)
    objects = [_cloud(label, xyz[owner == k], normals[owner == k], k + 1) for k, label in enumerate(things)]
    few = (slice(STEP // 2, None, STEP),) * 2
    known = np.isfinite(xyz[few][..., 2]) & (owner[few] < 0)
    return Keyframe(
        keyframe_id=0,
        session=0,
        stamp_ns=0,
        frame_id="camera",
        objects=tuple(KeyObject(cloud=cloud) for cloud in objects if len(cloud)),
        context=Context(xyz=xyz[few][known][::5], normals=normals[few][known][::5]),
        view=View(xyz=xyz[few], grey=None, intrinsics=CAMERA.scaled(STEP)),
        gravity=T_world_camera[:3, :3].T @ np.array([0.0, 0.0, -1.0]),
        gravity_confidence=1.0,
        T_odom_camera=None,
    )


def _cloud(label: str, xyz: Array, normals: Array, instance: int) -> ObjectCloud:
    return ObjectCloud(
        label=label,
        score=0.9,
        instance=instance,
        xyz=np.ascontiguousarray(xyz[::2]),
        normals=np.ascontiguousarray(normals[::2]),
        rgb=None,
        flags=np.zeros(len(xyz[::2]), np.uint16),
        density=1e4,
    )


def error(T: Array, source: float, target: float) -> tuple[float, float]:
    """(degrees, centimetres at the middle) of a pose between the cameras at two sides."""
    truth = inverse(from_side(target)) @ from_side(source)
    middle = transform(inverse(from_side(source)), np.array([0.0, 0.0, 0.08]))
    turned = truth[:3, :3].T @ T[:3, :3]
    degrees = np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1)))
    return float(degrees), float(100 * np.linalg.norm(transform(T, middle) - transform(truth, middle)))


def turned(angle_deg: float) -> Array:
    """A pose about up."""
    a = np.radians(angle_deg)
    c, s = np.cos(a), np.sin(a)
    return pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
