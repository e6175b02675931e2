# SPDX-License-Identifier: Apache-2.0
"""Frames of robots, as on /tf and /tf_static."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.geometry import pose, quaternion_from_rotation, rotation_from_vector

SECOND = 10**9


def transform(parent: str, child: str, T: np.ndarray, stamp_ns: int = 0) -> Any:
    x, y, z, w = quaternion_from_rotation(T[:3, :3])
    return SimpleNamespace(
        header=SimpleNamespace(
            frame_id=parent, stamp=SimpleNamespace(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
        ),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=T[0, 3], y=T[1, 3], z=T[2, 3]), rotation=SimpleNamespace(x=x, y=y, z=z, w=w)
        ),
    )


def moved(k: int) -> np.ndarray:
    rng = np.random.default_rng(k)
    return pose(rotation_from_vector(rng.normal(0, 1, 3)), rng.normal(0, 1, 3))


def turned(degrees: float) -> np.ndarray:
    """Turned about z, as a pan joint is."""
    return pose(rotation_from_vector(np.array([0.0, 0.0, np.radians(degrees)])), np.array([0.1, 0.0, 0.5]))


def said(*transforms: Any) -> Any:
    return SimpleNamespace(transforms=list(transforms))


def panning(*degrees: float, step_ns: int = SECOND // 10, start_ns: int = SECOND) -> FrameTree:
    """A head on a base that turns over time, and a camera on the head."""
    tree = FrameTree()
    tree.keep_history("eye")
    tree.add_transforms(said(transform("head", "eye", moved(1))))
    for k, angle in enumerate(degrees):
        tree.receive_moving(said(transform("base", "head", turned(angle), start_ns + k * step_ns)))
    return tree
