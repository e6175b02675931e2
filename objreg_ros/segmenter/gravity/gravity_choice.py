# SPDX-License-Identifier: Apache-2.0
"""The source of gravity: odometry, an IMU, or the picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.gravity.level_surfaces import camera_up, estimate_up, known_normals
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.surface.cells import Surface
from objreg_ros.sensor import gravity_confidence, gravity_sigma_deg

NORMALS = 3  # every so many of a surface are used
APART = 3.0  # deviations of both together: beyond, the picture took for level what is not


class GravityChoice(NamedTuple):
    """Up (3,) of length 1 in the camera frame or None, its confidence 0..1, its source, and the disagreement.

    ``source`` is ``imu``, ``picture``, ``odom`` or ``nothing``; ``disagreement_deg`` is the angle between the IMU's
    direction and the picture's, None where there are not both.
    """

    up: Array | None
    confidence: float
    source: str
    disagreement_deg: float | None = None


def find_gravity(
    surface: Surface, gravity: Array | None, sigma_deg: float | None, params: SegmenterParams
) -> GravityChoice:
    """The gravity of a frame: as it is given, as ``surface`` shows it, or the surer of both.

    ``gravity (3,)`` in the camera frame holds as it is where ``sigma_deg``, the standard deviation of its tilts, is
    None; ValueError for one of no length.
    """
    up = None if gravity is None else -_direction(gravity)
    if up is not None and sigma_deg is None:
        return GravityChoice(up, 1.0, "odom")
    seen, confidence = estimate_up(known_normals(surface.normals, NORMALS), camera_up(params.roll), params.up_tilt)
    if up is not None and sigma_deg is not None:
        return choose_gravity(up, sigma_deg, seen, confidence)
    return GravityChoice(seen, confidence, "nothing" if seen is None else "picture")


def choose_gravity(up: Array, sigma_deg: float, seen: Array | None, confidence: float) -> GravityChoice:
    """The surer one of the IMU's direction, ``up (3,)``, and the picture's, ``seen (3,)`` or None.

    Where they contradict each other, it is the IMU: no confidence of the picture distinguishes a slope from a floor.
    """
    felt = gravity_confidence(sigma_deg)
    if seen is None:
        return GravityChoice(up, felt, "imu") if felt > 0.0 else GravityChoice(None, 0.0, "nothing")
    cross = float(np.linalg.norm(np.cross(up, seen)))
    apart_deg = float(np.degrees(np.arctan2(cross, up @ seen)))
    seen_sigma_deg = gravity_sigma_deg(confidence)
    contradicts = apart_deg > APART * float(np.hypot(sigma_deg, seen_sigma_deg))
    if felt > 0.0 and (contradicts or sigma_deg <= seen_sigma_deg):
        return GravityChoice(up, felt, "imu", apart_deg)
    return GravityChoice(seen, confidence, "picture", apart_deg)


def _direction(gravity: Array) -> Array:
    length = float(np.linalg.norm(gravity))
    if not np.isfinite(length) or length < 1e-6:
        raise ValueError(f"gravity: expected a direction of non-zero length, got {np.asarray(gravity).tolist()}")
    return np.asarray(gravity, np.float64) / length
