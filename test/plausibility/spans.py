# SPDX-License-Identifier: Apache-2.0
"""Corners of a known room that a known camera sees along a known path."""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, Intrinsics
from objreg_ros.geometry import inverses, pose, rotation_from_vector
from objreg_ros.plausibility.corner_tracks import Span

CAMERA = Intrinsics(fx=130.0, fy=130.0, cx=79.5, cy=59.5, width=160, height=120)
STEP_NS = 500_000_000


def path(count: int, seed: int = 0, turn_deg: float = 9.0, shift_m: float = 0.12) -> Array:
    """``T_world_camera (count, 4, 4)``: a hand that turns about all axes and moves along all."""
    rng = np.random.default_rng(seed)
    T = [np.eye(4)]
    for _ in range(count - 1):
        turn = np.radians(turn_deg) * rng.uniform(-1.0, 1.0, 3)
        T.append(T[-1] @ pose(rotation_from_vector(turn), shift_m * rng.uniform(-1.0, 1.0, 3)))
    return np.array(T)


def spans(T_world_camera: Array, camera: Intrinsics = CAMERA, seed: int = 0, noise_px: float = 0.1) -> list[Span]:
    """A span between each two poses: corners at 1 to 3 m in front of the first one."""
    rng = np.random.default_rng(seed)
    motions = inverses(T_world_camera[1:]) @ T_world_camera[:-1]
    return [_span(T, k, camera, rng, noise_px) for k, T in enumerate(motions)]


def _span(T_last_first: Array, k: int, camera: Intrinsics, rng: np.random.Generator, noise_px: float) -> Span:
    uv = rng.uniform((15.0, 15.0), (camera.width - 15.0, camera.height - 15.0), (60, 2))
    z = rng.uniform(1.0, 3.0, 60)
    rays = (uv - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    points = np.column_stack([rays * z[:, None], z])
    there = points @ T_last_first[:3, :3].T + T_last_first[:3, 3]
    seen = there[:, :2] / there[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    uv_last = seen + noise_px * rng.standard_normal(seen.shape)
    return Span(k * STEP_NS, (k + 1) * STEP_NS, uv, z, uv_last, there[:, 2])
