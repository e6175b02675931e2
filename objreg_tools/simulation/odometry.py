# SPDX-License-Identifier: Apache-2.0
"""Odometry that drifts as real odometry does: by what is wrong with it for the whole run, and a little at random.

After one metre the relative pose error is about ``distance_drift`` in position and ``turn_drift`` in heading:

* the heading turns steadily with the path, as with unequal wheels (Borenstein and Feng, "Measurement and Correction of
  Systematic Odometry Errors in Mobile Robots", 1996), and wanders; the wandering is a tenth of the variance,
* every motion is wrong by a constant share of its length, as much along it (scale) as across it (mounting), and the
  position wanders; the wandering is half of the variance,
* a tilt error wanders about zero with the standard deviation ``tilt_error``, because gravity is observed,
* each pose errs for itself by ``turn_jitter`` and ``distance_jitter`` (root mean square, white): a jittering tracker.

What is constant has a sign at random and a size within a quarter of the stated one, so that every run drifts about as
much. What wanders grows with the root of the path length; what is constant grows with the path length.

The odometry frame has z up and begins under the first camera, its x axis where that camera looks.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.simulation.params import OdometryParams

Random = np.random.Generator

TILT_MEMORY_M = 1.0
"""The tilt error is forgotten over about this distance."""
STEADY_HEADING = 0.9
"""Share of the variance of the heading's error after one metre that is constant."""
STEADY_POSITION = 0.5
"""The same of the position's."""
VARIETY = 0.25
"""The largest relative difference between the size of a constant error and the stated one."""


def drifted(T_world_camera: Array, params: OdometryParams, seed: int) -> tuple[Array, Array]:
    """``T_odom_camera (N, 4, 4)`` of true poses ``T_world_camera (N, 4, 4)``, and their covariances (N, 6, 6).

    The covariances are what the model says of the pose after the distance moved, ROS order, metres and radians.
    """
    rng = np.random.default_rng([seed, 21])
    start = odometry_origin(T_world_camera[0])
    moved = np.diff(T_world_camera[:, :3, 3], axis=0) @ start[:3, :3]  # in the frame of odometry
    length = np.linalg.norm(moved, axis=1)
    heading = _heading(length, np.radians(params.turn_drift), rng)
    believed = _believed(moved, length, params.distance_drift, rng)
    tilt = _wandering(length, np.radians(params.tilt_error), rng)
    out, at = [], inverse(start)[:3, :3] @ (T_world_camera[0, :3, 3] - start[:3, 3])
    for k, T in enumerate(T_world_camera):
        if k > 0:
            at = at + _turn(heading[k - 1]) @ believed[k - 1]
        out.append(pose(_turn(heading[k]) @ rotation_from_vector(tilt[k]) @ start[:3, :3].T @ T[:3, :3], at))
    covariances = _covariances(np.concatenate([[0.0], np.cumsum(length)]), params)
    return jittered(np.stack(out), params, seed), covariances


def jittered(T_odom_camera: Array, params: OdometryParams, seed: int) -> Array:
    """Poses (N, 4, 4) that each err for themselves besides: in position, and in rotation about their own camera."""
    if not (params.turn_jitter or params.distance_jitter):
        return T_odom_camera
    noise = np.random.default_rng([seed, 22]).standard_normal((len(T_odom_camera), 2, 3)) / np.sqrt(3.0)
    turns, shifts = np.radians(params.turn_jitter) * noise[:, 0], params.distance_jitter * noise[:, 1]
    rotations = np.array([T[:3, :3] @ rotation_from_vector(turn) for T, turn in zip(T_odom_camera, turns, strict=True)])
    return np.stack([pose(R, T[:3, 3] + s) for R, T, s in zip(rotations, T_odom_camera, shifts, strict=True)])


def odometry_origin(T_world_camera: Array) -> Array:
    """``T_world_odom``: z up, on the floor under a camera, x where the camera looks."""
    forward = T_world_camera[:3, 2] * [1.0, 1.0, 0.0]
    norm = np.linalg.norm(forward)
    x = forward / norm if norm > 1e-6 else np.array([1.0, 0.0, 0.0])
    z = np.array([0.0, 0.0, 1.0])
    return pose(np.stack([x, np.cross(z, x), z], axis=1), T_world_camera[:3, 3] * [1.0, 1.0, 0.0])


def _turn(heading: float) -> Array:
    return rotation_from_vector(np.array([0.0, 0.0, heading]))


def _about(size: float, rng: Random) -> float:
    """A constant error of about this size."""
    return size * float(rng.choice([-1.0, 1.0])) * float(rng.uniform(1.0 - VARIETY, 1.0 + VARIETY))


def _heading(length: Array, drift: float, rng: Random) -> Array:
    """(N,) radians of heading error, from zero; ``drift`` after one metre."""
    steady = _about(drift * np.sqrt(STEADY_HEADING), rng)
    walk = drift * np.sqrt(1.0 - STEADY_HEADING) * np.sqrt(length) * rng.standard_normal(len(length))
    return np.concatenate([[0.0], np.cumsum(steady * length + walk)])


def _believed(moved: Array, length: Array, drift: float, rng: Random) -> Array:
    """(N - 1, 3) what is believed of the true motions; ``drift`` is the error after one metre, as a share of it."""
    steady = drift * np.sqrt(STEADY_POSITION / 2)
    along, across = _about(steady, rng), _about(steady, rng)
    wrong = np.array([[1.0 + along, -across, 0.0], [across, 1.0 + along, 0.0], [0.0, 0.0, 1.0 + along]])
    each_axis = drift * np.sqrt((1.0 - STEADY_POSITION) / 3)
    return np.asarray(moved @ wrong.T + each_axis * np.sqrt(length)[:, None] * rng.standard_normal((len(length), 3)))


def _wandering(length: Array, deviation: float, rng: Random) -> Array:
    """(N, 3) rotation vectors, horizontal, from zero: an Ornstein-Uhlenbeck process over distance."""
    out = np.zeros((len(length) + 1, 3))
    for k, step in enumerate(length):
        keep = np.exp(-step / TILT_MEMORY_M)
        out[k + 1, :2] = keep * out[k, :2] + deviation * np.sqrt(1 - keep**2) * rng.standard_normal(2)
    return out


def _covariances(distance: Array, params: OdometryParams) -> Array:
    """Diagonal (N, 6, 6) covariances after so many metres, never below (1 mm)^2 and (0.05 deg)^2."""
    d = distance[:, None]
    heading = np.radians(params.turn_drift) * _growth(d, STEADY_HEADING)
    position = params.distance_drift * _growth(d, STEADY_POSITION) + 0.5 * heading * d
    tilt = np.full_like(d, np.radians(params.tilt_error))
    sigma = np.concatenate([position, position, position, tilt, tilt, heading], axis=1)
    floor = np.array([1e-3] * 3 + [np.radians(0.05)] * 3)
    jitter = np.array([params.distance_jitter] * 3 + [np.radians(params.turn_jitter)] * 3) / np.sqrt(3.0)
    return (np.maximum(sigma, floor) ** 2 + jitter**2)[:, :, None] * np.eye(6)


def _growth(distance: Array, steady: float) -> Array:
    """The standard deviation after a distance in m, 1 after the first, where ``steady`` of the variance is constant."""
    return np.asarray(np.sqrt(steady * distance**2 + (1.0 - steady) * distance))
