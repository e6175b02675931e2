# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.bridge.messages import headers, motion_from_msg
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_tools.recording import open_recording
from objreg_tools.recording.drift import ODOM, Drift, DriftingOdometry, with_drifting_odometry

from .sample_folders import lost, tum_folder


def walk(steps: int) -> list[np.ndarray]:
    """1 cm forward and half a degree to the side, again and again, from somewhere in the world."""
    step = pose(rotation_from_vector(np.array([0, np.radians(0.5), 0])), np.array([0, 0, 0.01]))
    poses = [pose(rotation_from_vector(np.array([0.1, 0.7, -0.2])), np.array([3.0, -1.0, 2.0]))]
    for _ in range(steps):
        poses.append(poses[-1] @ step)
    return poses


def test_without_drift_it_is_the_truth_from_its_own_start() -> None:
    odometry = DriftingOdometry(0, Drift(0, 0, 0, 0))
    truth = walk(50)
    poses = [odometry.step(T) for T in truth]
    assert np.array_equal(poses[0], np.eye(4))
    assert np.allclose(poses[-1], inverse(truth[0]) @ truth[-1])


def test_the_same_seed_drifts_the_same_and_another_does_not() -> None:
    ends = []
    for seed in (1, 1, 2):
        odometry = DriftingOdometry(seed)
        ends.append([odometry.step(T) for T in walk(20)][-1])
    assert np.array_equal(ends[0], ends[1]) and not np.allclose(ends[0], ends[2])


def test_the_drift_after_a_metre_is_of_its_order_and_not_nothing() -> None:
    errors = []
    for seed in range(40):
        odometry, truth = DriftingOdometry(seed), walk(100)
        errors.append(pose_error([odometry.step(T) for T in truth][-1], inverse(truth[0]) @ truth[-1]))
    degrees, centimetres = np.median(errors, axis=0)
    assert 0.3 < degrees < 3 and 0.5 < centimetres < 6


def test_every_true_pose_is_followed_by_odometry_of_its_stamp(tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path))
    records = list(with_drifting_odometry(recording.records(), "/ground_truth", seed=3))
    odom = [r.message for r in records if r.topic == ODOM]
    assert [headers.stamp_ns(m) for m in odom] == [0, 100_000_000, 200_000_000]
    moved = np.linalg.norm(motion_from_msg.odometry(odom[1]).T_odom_body[:3, 3])
    assert moved == pytest.approx(0.5, abs=0.1) and len(records) == 15


def test_a_moment_without_a_true_pose_has_no_odometry(tmp_path: Path) -> None:
    records = open_recording(tum_folder(tmp_path, frames=4)).records(["/ground_truth"])
    truth = [lost(record) if record.stamp_ns == 100_000_000 else record for record in records]
    odom = [r.stamp_ns for r in with_drifting_odometry(truth, "/ground_truth", seed=3) if r.topic == ODOM]
    assert odom == [0, 200_000_000, 300_000_000]
