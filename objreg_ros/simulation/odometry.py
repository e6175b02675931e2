# SPDX-License-Identifier: Apache-2.0
"""Odometry that drifts as visual odometry does.

Between two frames the true motion is known. Odometry gets it with

* a scale error, drawn once, of standard deviation ``distance_drift`` / sqrt(2),
* a position error that walks: after one metre its standard deviation along each axis is ``distance_drift`` / sqrt(2),
* a heading error whose rate per metre is half constant and half white: after d metres its standard deviation is
  ``turn_drift`` * sqrt((d^2 + d) / 2), which is ``turn_drift`` after the first metre,
* a tilt error that wanders about zero with the standard deviation ``tilt_error``, because gravity is observed.

The odometry frame has z up and begins under the first camera, its x axis where that camera looks.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.simulation.params import OdometryParams

TILT_MEMORY_M = 1.0
"""The tilt error is forgotten over about this distance."""


def drifted(T_world_camera: Array, params: OdometryParams, seed: int) -> tuple[Array, Array]:
    """``T_odom_camera (N, 4, 4)`` of true poses ``T_world_camera (N, 4, 4)``, and their covariances (N, 6, 6).

    The covariances are what the model says of the pose after the distance moved, ROS order, metres and radians.
    """
    rng = np.random.default_rng([seed, 21])
    start = odometry_origin(T_world_camera[0])
    moved = np.diff(T_world_camera[:, :3, 3], axis=0) @ start[:3, :3]  # in the frame of odometry
    length = np.linalg.norm(moved, axis=1)
    root = np.sqrt(length)
    share = params.distance_drift / np.sqrt(2)
    turn = np.radians(params.turn_drift) / np.sqrt(2)
    scale = 1.0 + share * rng.standard_normal()
    heading = np.cumsum(turn * (rng.standard_normal() * length + root * rng.standard_normal(len(length))))
    heading = np.concatenate([[0.0], heading])
    tilt = _wandering(length, np.radians(params.tilt_error), rng)
    walk = share * root[:, None] * rng.standard_normal((len(length), 3))
    out, at = [], inverse(start)[:3, :3] @ (T_world_camera[0, :3, 3] - start[:3, 3])
    for k, T in enumerate(T_world_camera):
        turned = rotation_from_vector(np.array([0.0, 0.0, heading[k]])) @ rotation_from_vector(tilt[k])
        if k > 0:
            at = at + rotation_from_vector(np.array([0.0, 0.0, heading[k - 1]])) @ (scale * moved[k - 1]) + walk[k - 1]
        out.append(pose(turned @ start[:3, :3].T @ T[:3, :3], at))
    return np.stack(out), _covariances(np.concatenate([[0.0], np.cumsum(length)]), params)


def odometry_origin(T_world_camera: Array) -> Array:
    """``T_world_odom``: z up, on the floor under a camera, x where the camera looks."""
    forward = T_world_camera[:3, 2] * [1.0, 1.0, 0.0]
    norm = np.linalg.norm(forward)
    x = forward / norm if norm > 1e-6 else np.array([1.0, 0.0, 0.0])
    z = np.array([0.0, 0.0, 1.0])
    return pose(np.stack([x, np.cross(z, x), z], axis=1), T_world_camera[:3, 3] * [1.0, 1.0, 0.0])


def _wandering(length: Array, deviation: float, rng: np.random.Generator) -> Array:
    """(N, 3) rotation vectors, horizontal, from zero: an Ornstein-Uhlenbeck process over distance."""
    out = np.zeros((len(length) + 1, 3))
    for k, step in enumerate(length):
        keep = np.exp(-step / TILT_MEMORY_M)
        out[k + 1, :2] = keep * out[k, :2] + deviation * np.sqrt(1 - keep**2) * rng.standard_normal(2)
    return out


def _covariances(distance: Array, params: OdometryParams) -> Array:
    """Diagonal (N, 6, 6) covariances after so many metres, never below (1 mm)^2 and (0.05 deg)^2."""
    d = distance[:, None]
    heading = np.radians(params.turn_drift) * np.sqrt((d**2 + d) / 2)
    position = params.distance_drift * np.sqrt((d**2 + d) / 2) + 0.5 * heading * d
    tilt = np.full_like(d, np.radians(params.tilt_error))
    sigma = np.concatenate([position, position, position, tilt, tilt, heading], axis=1)
    floor = np.array([1e-3] * 3 + [np.radians(0.05)] * 3)
    return np.maximum(sigma, floor)[:, :, None] ** 2 * np.eye(6)
