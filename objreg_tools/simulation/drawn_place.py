# SPDX-License-Identifier: Apache-2.0
"""A small drawn place, as the segmenter would give it: for trials that need a frame and no rendering."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)


def drawn(stamp_ns: int) -> Frame:
    """Two boxes on a table, seen from above, all with a pattern."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    depth = (1.6 - 0.005 * v).astype(np.float32)
    boxes = (v // 30 == 1) & (u // 20 % 4 == 1)
    depth[boxes] -= 0.2
    xyz = back_project(depth, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy).astype(np.float32)
    grey = ((u * u // 7 + v * 13) % 256).astype(np.uint8)
    left, right = (boxes & (u // 80 == side) for side in (0, 1))
    return Frame(
        objects=(_object("cup", 1, xyz[left]), _object("book", 2, xyz[right])),
        support=_object("support", 0, xyz[~boxes][::7]),
        view=View(xyz=xyz, grey=grey, intrinsics=CAMERA),
        gravity=np.array([0.0, 0.6, 0.8]),
        gravity_confidence=1.0,
        T_odom_camera=None,
        stamp_ns=stamp_ns,
    )


def _object(label: str, instance: int, xyz: Array) -> ObjectCloud:
    return ObjectCloud(
        label=label,
        score=1.0,
        instance=instance,
        xyz=xyz,
        normals=np.tile(np.array([0, 0, -1], np.float32), (len(xyz), 1)),
        rgb=np.full((len(xyz), 3), 127, np.uint8),
        flags=np.zeros(len(xyz), np.uint16),
        density=1e4,
    )
