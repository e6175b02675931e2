# SPDX-License-Identifier: Apache-2.0
"""What odometry has reported of late, to be asked for at any time."""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import pose

APART_NS = 20_000_000  # samples that are nearer to the last one are left out
MOST_SAMPLES = 10_000  # more than three minutes at that rate
MOST_GAP_S = 0.5  # nothing is interpolated over a longer one


class OdometryTrack:
    """The poses of one odometry, the newest `MOST_SAMPLES`. A clock that goes back begins it anew."""

    def __init__(self) -> None:
        self._stamps: deque[int] = deque(maxlen=MOST_SAMPLES)
        self._poses: deque[Array] = deque(maxlen=MOST_SAMPLES)
        self._arrays: tuple[Array, Array, Array] | None = None
        self.frame_id = self.child_frame_id = ""

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def span_ns(self) -> tuple[int, int]:
        """The first and the last stamp; ValueError before any."""
        if not self._stamps:
            raise ValueError("expected samples of odometry, got none")
        return self._stamps[0], self._stamps[-1]

    def add_odometry(self, sample: Odometry) -> None:
        """Take one sample in."""
        if self._stamps and sample.stamp_ns < self._stamps[-1]:
            self._stamps.clear()
            self._poses.clear()
        if self._stamps and sample.stamp_ns - self._stamps[-1] < APART_NS:
            return
        self._stamps.append(sample.stamp_ns)
        self._poses.append(sample.T_odom_body)
        self.frame_id, self.child_frame_id, self._arrays = sample.frame_id, sample.child_frame_id, None

    def at(self, stamps_ns: Array) -> tuple[Array, Array]:
        """``T_odom_body (n, 4, 4)`` at some times, and whether (n,) it is known there; the identity where it is not."""
        if len(self._stamps) < 2:
            return np.broadcast_to(np.eye(4), (len(stamps_ns), 4, 4)), np.zeros(len(stamps_ns), bool)
        seconds, positions, quaternions = self._as_arrays()
        wanted = 1e-9 * (np.asarray(stamps_ns) - self._stamps[0])
        after = np.clip(np.searchsorted(seconds, wanted), 1, len(seconds) - 1)
        gap = seconds[after] - seconds[after - 1]
        known = (wanted >= seconds[0]) & (wanted <= seconds[-1]) & (gap <= MOST_GAP_S)
        share = np.clip((wanted - seconds[after - 1]) / gap, 0.0, 1.0)[:, None]
        before, behind = quaternions[after - 1], quaternions[after]
        behind = np.where(np.sum(before * behind, axis=1, keepdims=True) < 0, -behind, behind)
        R = Rotation.from_quat((1 - share) * before + share * behind).as_matrix()
        t = (1 - share) * positions[after - 1] + share * positions[after]
        return np.where(known[:, None, None], pose(R, t), np.eye(4)), known

    def _as_arrays(self) -> tuple[Array, Array, Array]:
        if self._arrays is None:
            poses = np.array(self._poses)
            seconds = 1e-9 * (np.array(self._stamps, np.int64) - self._stamps[0])
            self._arrays = seconds, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        return self._arrays
