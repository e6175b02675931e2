# SPDX-License-Identifier: Apache-2.0
"""Views of a box with spotted walls: what a depth camera in it sees, at any pose."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from objreg_ros.data import Array, Intrinsics, View
from plausibility.spans import CAMERA

NEAR, FAR = np.array([-1.6, -1.2, -2.0]), np.array([1.6, 1.2, 3.0])  # corners of the box, m; the camera begins at 0
SPOT_M = 0.05
WALL = 128  # spots across a wall


def _walls(seed: int = 0) -> list[Array]:
    rng = np.random.default_rng(seed)
    return [cv2.GaussianBlur(rng.uniform(0, 255, (WALL, WALL)).astype(np.float32), (0, 0), 1.0) for _ in range(6)]


WALLS = _walls()
COLUMNS, ROWS = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))


def view(T_world_camera: Array, stated: Intrinsics = CAMERA, depth_scale: float = 1.0) -> View:
    """What the camera of `spans` sees, as a stream that says ``stated`` of its camera and of its depth has it."""
    z, grey = _seen(T_world_camera.tobytes())
    z = z * depth_scale
    x, y = (COLUMNS - stated.cx) / stated.fx * z, (ROWS - stated.cy) / stated.fy * z
    return View(xyz=np.stack([x, y, z], axis=-1).astype(np.float32), grey=grey, intrinsics=stated)


@lru_cache(maxsize=256)
def _seen(pose_bytes: bytes) -> tuple[Array, Array]:
    T_world_camera = np.frombuffer(pose_bytes).reshape(4, 4)
    rays = np.stack([(COLUMNS - CAMERA.cx) / CAMERA.fx, (ROWS - CAMERA.cy) / CAMERA.fy, np.ones(ROWS.shape)], axis=-1)
    return _cast(rays @ T_world_camera[:3, :3].T, T_world_camera[:3, 3])


def _cast(rays: Array, origin: Array) -> tuple[Array, Array]:
    """How many times its ray a pixel is away, and how bright it is there."""
    towards = np.where(rays > 0, FAR, NEAR)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(rays == 0, np.inf, (towards - origin) / rays)
    axis, z = far.argmin(axis=-1), far.min(axis=-1)
    points = origin + rays * z[..., None]
    grey = np.zeros(z.shape, np.float32)
    for k, wall in enumerate(WALLS):
        of_wall = (axis == k // 2) & ((np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0) == bool(k % 2))
        across, down = (((points[..., i] / SPOT_M) % WALL).astype(np.float32) for i in range(3) if i != k // 2)
        spots = cv2.remap(wall, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        grey = np.where(of_wall, spots, grey)
    grey = (grey - grey.min()) / max(1e-6, float(np.ptp(grey))) * 255.0
    return z, grey.astype(np.uint8)
