# SPDX-License-Identifier: Apache-2.0
"""Views of a box with speckled walls, from the inside, and a camera that swings through it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Odometry, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project, inverse, pose, rotation_from_vector
from plausibility.moving import CAMERA, MOUNT

HALF_M = np.array([2.0, 1.3, 2.5])
RATE_HZ = 10.0


def speckles(side: int = 512, seed: int = 0) -> Array:
    """A picture of smooth random spots, (side, side) uint8."""
    noise = np.random.default_rng(seed).normal(size=(side, side)).astype(np.float32)
    spots = cv2.GaussianBlur(noise, (0, 0), 3.0)
    return np.clip(128 + 60 * spots / spots.std(), 0, 255).astype(np.uint8)


WALLS = [speckles(seed=seed) for seed in range(6)]


def depth_and_grey(T_room_camera: Array, camera: Intrinsics = CAMERA) -> tuple[Array, Array]:
    """What the camera sees of the box: depth (h, w) float32 m and grey (h, w) uint8."""
    ones = np.ones((camera.height, camera.width))
    rays = back_project(ones, camera.fx, camera.fy, camera.cx, camera.cy) @ T_room_camera[:3, :3].T
    start = T_room_camera[:3, 3]
    reach = (np.sign(rays) * HALF_M - start) / np.where(rays == 0.0, np.finfo(float).tiny, rays)
    axis, z = reach.argmin(axis=-1), reach.min(axis=-1)
    hit = start + rays * z[..., None]
    grey = np.zeros(z.shape, np.uint8)
    for k in range(3):
        across, along = (((hit[..., i] + 3.0) * 85.0).astype(np.float32) for i in range(3) if i != k)
        for side in (0, 1):
            wall = cv2.remap(WALLS[2 * k + side], across, along, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
            there = (axis == k) & ((rays[..., k] > 0) == bool(side))
            grey[there] = wall[there]
    return z.astype(np.float32), grey


def seen_as(depth: Array, grey: Array | None, camera: Intrinsics = CAMERA) -> View:
    """The view of a camera that says of itself to be ``camera``."""
    xyz = back_project(depth, camera.fx, camera.fy, camera.cx, camera.cy)
    return View(xyz=xyz, grey=grey, intrinsics=camera)


def longer(camera: Intrinsics, share: float) -> Intrinsics:
    """A camera of ``share`` times the focal length."""
    return replace(camera, fx=share * camera.fx, fy=share * camera.fy)


def swinging(seconds: Array, pace: float = 1.0) -> Array:
    """Poses ``T_room_camera (n, 4, 4)`` of a camera that is carried about and looks around."""
    t = pace * seconds[:, None]
    turns = np.sin(t * [1.1, 0.9, 0.7] + [0.0, 0.5, 1.0]) * [0.25, 0.7, 0.15]
    places = np.sin(t * [0.7, 0.8, 0.6] + [0.3, 0.0, 2.0]) * [0.7, 0.3, 0.6]
    return pose(rotation_from_vector(turns), places)


def odometry(seconds: Array, T_room_camera: Array, late_s: float = 0.0) -> list[Odometry]:
    """What the body reports that carries the camera by `MOUNT`."""
    T_room_body = T_room_camera @ inverse(MOUNT)
    stamps_ns = np.rint(1e9 * (seconds + late_s)).astype(np.int64)
    return [Odometry(T_odom_body=T, stamp_ns=int(stamp_ns)) for T, stamp_ns in zip(T_room_body, stamps_ns, strict=True)]
