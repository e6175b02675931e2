# SPDX-License-Identifier: Apache-2.0
"""A flat of two rooms of boxes, seen by an exact depth camera: x right, y ahead, z up, the floor at z = 0.

The first lies over x 0..4, y 0..3, the second behind its wall at y = 3, which has an opening over x 1..2. A table of
0.8 m by 0.6 m stands at the wall x = 4: a top between z 0.7 and 0.75 on nothing.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project, pose, transform

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.625, cy=59.625, width=160, height=120)
TALL = 2.5
BOXES = np.array(  # low and high corners, m
    [
        [[-0.2, -0.2, 0], [0.0, 6.2, TALL]],
        [[4.0, -0.2, 0], [4.2, 6.2, TALL]],
        [[-0.2, -0.2, 0], [4.2, 0.0, TALL]],
        [[-0.2, 6.0, 0], [4.2, 6.2, TALL]],
        [[0.0, 3.0, 0], [1.0, 3.1, TALL]],
        [[2.0, 3.0, 0], [4.0, 3.1, TALL]],
        [[3.2, 1.2, 0.7], [4.0, 1.8, 0.75]],
        [[-9, -9, -0.1], [9, 9, 0.0]],
    ]
)


def looking(x: float, y: float, yaw_deg: float, down_deg: float = 15.0, z: float = 1.3) -> Array:
    """``T_world_camera`` of an upright camera (optical frame) that looks along ``yaw_deg`` from the axis x to y."""
    yaw, down = np.radians([yaw_deg, down_deg])
    ahead = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    return pose(np.stack([right, np.cross(ahead, right), ahead], axis=1), np.array([x, y, z]))


def walk() -> list[Array]:
    """Places in both rooms, from each of which the camera looks around."""
    spots = [(1.5, 1.0), (2.5, 1.5), (1.5, 2.2), (1.5, 3.8), (2.5, 4.6)]
    return [looking(x, y, yaw) for x, y in spots for yaw in range(0, 360, 40)]


def see(T_world_camera: Array, boxes: Array = BOXES, noise: float = 0.0) -> View:
    """What the camera sees of it, by the slabs of each box; ``noise`` m of depth at 1 m, growing with its square."""
    rays = back_project(np.ones((CAMERA.height, CAMERA.width)), CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    along, origin = rays @ T_world_camera[:3, :3].T, T_world_camera[:3, 3]
    with np.errstate(divide="ignore"):
        sides = (boxes[:, :, None, None, :] - origin) / along  # (boxes, 2, h, w, 3)
    first, last = sides.min(axis=1).max(axis=-1), sides.max(axis=1).min(axis=-1)
    depth = np.where((first <= last) & (first > 0.0), first, np.inf).min(axis=0)
    if noise:
        depth = depth + np.random.default_rng(5).normal(size=depth.shape) * noise * depth**2
    xyz = np.where(np.isfinite(depth)[..., None], rays * depth[..., None], np.nan).astype(np.float32)
    return View(xyz=xyz, grey=None, intrinsics=CAMERA)


def world(T_world_camera: Array, view: View) -> Array:
    """The points of a view (h, w, 3) in the world."""
    return transform(T_world_camera, view.xyz.astype(float))
