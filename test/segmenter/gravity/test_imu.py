# SPDX-License-Identifier: Apache-2.0
"""Where an IMU is mounted."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.frames import FeltGravity
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.segmenter.gravity.imu import Imu

BODY_IN_OPTICAL = pose(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.array([0.1, 0, 0]))  # x ahead, z up


def felt(frame_id: str = "imu_link") -> FeltGravity:
    return FeltGravity(gravity=np.array([0.0, 0.0, -1.0]), gravity_sigma_deg=0.8, stamp_ns=5, frame_id=frame_id)


def test_the_mounting_turns_gravity_into_the_camera() -> None:
    turned = Imu(BODY_IN_OPTICAL).in_camera(felt(), "eye")
    assert turned is not None and turned.gravity == pytest.approx([0.0, 1.0, 0.0])
    assert (turned.frame_id, turned.stamp_ns, turned.gravity_sigma_deg) == ("eye", 5, 0.8)
    tilted = BODY_IN_OPTICAL @ pose(rotation_from_vector(np.array([0.0, np.radians(10.0), 0.0])), np.zeros(3))
    turned = Imu(tilted).in_camera(felt(), "eye")
    assert turned is not None and turned.gravity @ np.array([0.0, 1.0, 0.0]) == pytest.approx(np.cos(np.radians(10.0)))


def test_frames_that_are_known_to_be_tied_need_no_parameter() -> None:
    known = {("eye", "imu_link"): BODY_IN_OPTICAL}
    turned = Imu(None, lambda camera, imu: known.get((camera, imu))).in_camera(felt("/imu_link"), "/eye")
    assert turned is not None and turned.gravity == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize(("imu", "camera"), [("eye", "eye"), ("/eye", "eye"), ("", "eye"), ("imu_link", "")])
def test_an_imu_of_the_cameras_own_frame_or_of_none_needs_no_mounting(imu: str, camera: str) -> None:
    turned = Imu().in_camera(felt(imu), camera)
    assert turned is not None and turned.gravity == pytest.approx([0.0, 0.0, -1.0])


def test_an_imu_that_is_mounted_nobody_knows_how_gives_nothing_and_is_counted() -> None:
    imu = Imu()
    assert imu.in_camera(felt(), "eye") is None and imu.counts == {"unknown_frame": 1}
