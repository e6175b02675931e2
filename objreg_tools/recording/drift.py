# SPDX-License-Identifier: Apache-2.0
"""Odometry that drifts, made from ground truth: for recordings without odometry. A stand-in, never a measurement."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_angle, rotation_from_vector
from objreg_tools.recording.poses import pose_of
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag import messages

ODOM = "/drifting_odom"


@dataclass(frozen=True, slots=True)
class Drift:
    """How a good visual odometry errs: a random walk that grows with the path, and a scale that is a little off."""

    translation: float = 0.02  # m after 1 m, one sigma; grows with the root of the path length
    rotation_deg: float = 1.0  # degrees after 1 m, likewise
    rotation_share: float = 0.01  # of the angle that is turned
    scale: float = 0.01  # one sigma of the scale's error


class DriftingOdometry:
    """Poses with drift from true poses, in order of time; the same seed gives the same drift."""

    def __init__(self, seed: int, drift: Drift | None = None) -> None:
        self._drift, self._random = drift or Drift(), np.random.default_rng(seed)
        self._scale = 1.0 + self._drift.scale * self._random.standard_normal()
        self._T_world_last: Array | None = None
        self._T_odom_last = np.eye(4)

    def step(self, T_world_camera: Array) -> Array:
        """``T_odom_camera`` for the next true pose; the first is the identity."""
        if self._T_world_last is not None:
            motion = inverse(self._T_world_last) @ T_world_camera
            self._T_odom_last = self._T_odom_last @ self._disturbed(motion)
        self._T_world_last = T_world_camera
        return self._T_odom_last

    def _disturbed(self, motion: Array) -> Array:
        drift, length = self._drift, float(np.linalg.norm(motion[:3, 3]))
        turn = np.radians(drift.rotation_deg) * np.sqrt(length) + drift.rotation_share * rotation_angle(motion[:3, :3])
        R = motion[:3, :3] @ rotation_from_vector(turn * self._random.standard_normal(3) / np.sqrt(3))
        wander = drift.translation * np.sqrt(length) * self._random.standard_normal(3) / np.sqrt(3)
        return pose(R, self._scale * motion[:3, 3] + wander)


def with_drifting_odometry(records: Iterable[Record], ground_truth: str, seed: int) -> Iterator[Record]:
    """The records, and behind each pose of the topic ``ground_truth`` an Odometry on `ODOM` of the same stamp."""
    odometry = DriftingOdometry(seed)
    for record in records:
        yield record
        truth = pose_of(record) if record.topic == ground_truth else None
        if truth is not None:
            T_odom_camera = odometry.step(truth.T_odom_body)
            message = messages.odometry(T_odom_camera, np.eye(6), truth.stamp_ns, "odom", "camera")
            yield Record.of(ODOM, message, record.stamp_ns)
