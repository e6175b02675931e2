# SPDX-License-Identifier: Apache-2.0
"""Odometry of recordings that jitters."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import frame, moved

from objreg_ros.geometry import pose_error


def test_jitter_moves_each_pose_of_odometry_for_itself_and_leaves_frames_without() -> None:
    from sources import with_jitter

    frames = [frame(0.1 * k, T_odom_camera=None if k % 10 == 0 else moved(0.01 * k)) for k in range(200)]
    found = with_jitter(frames, (3.0, 4.0), seed=1)
    assert [one.T_odom_camera is None for one in found] == [k % 10 == 0 for k in range(200)]
    posed = [
        (a.T_odom_camera, b.T_odom_camera) for a, b in zip(found, frames, strict=True) if b.T_odom_camera is not None
    ]
    errors = np.array([pose_error(a, b) for a, b in posed])
    assert np.sqrt(np.mean(errors**2, axis=0)) == pytest.approx([3.0, 4.0], rel=0.2)
    assert with_jitter(frames, (0.0, 0.0), seed=1) is frames
