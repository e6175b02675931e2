# SPDX-License-Identifier: Apache-2.0
"""Corners that a known camera sees on known motions, and motions of a body that carries it."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.plausibility.corner_tracks import Span

CAMERA = Intrinsics(fx=140.0, fy=140.0, cx=79.5, cy=59.5, width=160, height=120)
MOUNT = pose(
    np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]) @ rotation_from_vector(np.array([0.2, 0, 0.1])),
    np.array([0.2, -0.1, 0.3]),
)


def random_motions(count: int, seed: int = 0, turn: float = 0.12, shift_m: float = 0.1) -> Array:
    """Motions (n, 4, 4) about and along any axes; the standard deviations are those of each axis."""
    rng = np.random.default_rng(seed)
    return pose(rotation_from_vector(rng.normal(0, turn, (count, 3))), rng.normal(0, shift_m, (count, 3)))


def level_motions(count: int, seed: int = 0) -> Array:
    """Motions (n, 4, 4) of a body on wheels: forward, with turns about the vertical."""
    rng = np.random.default_rng(seed)
    turns = np.zeros((count, 3))
    turns[:, 2] = rng.uniform(-0.4, 0.4, count)
    shifts = np.zeros((count, 3))
    shifts[:, 0] = rng.uniform(0.05, 0.3, count)
    return pose(rotation_from_vector(turns), shifts)


def carried(T_body: Array, T_body_camera: Array = MOUNT, scale: float = 1.0) -> Array:
    """The motions (n, 4, 4) of a camera on that body, whose metres are ``scale`` times as long."""
    T_camera = inverse(T_body_camera) @ T_body @ T_body_camera
    T_camera[:, :3, 3] *= scale
    return T_camera


def seen_spans(T_last_first: Array, camera: Intrinsics = CAMERA, seed: int = 0, noise_px: float = 0.1) -> list[Span]:
    """What the camera sees of 30 points at both ends of each motion."""
    rng = np.random.default_rng(seed)
    return [_seen(k, T, camera, rng, noise_px) for k, T in enumerate(T_last_first)]


def _seen(k: int, T: Array, camera: Intrinsics, rng: np.random.Generator, noise_px: float) -> Span:
    uv = rng.uniform([5, 5], [camera.width - 5, camera.height - 5], (30, 2))
    z = rng.uniform(1.0, 3.0, 30)
    focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    xyz = transform(T, np.hstack([(uv - centre) / focal * z[:, None], z[:, None]]))
    moved = xyz[:, :2] / xyz[:, 2:] * focal + centre + rng.normal(0, noise_px, (30, 2))
    first_ns = k * 10**9
    return Span(first_ns, first_ns + 5 * 10**8, uv, z, moved, xyz[:, 2])
