# SPDX-License-Identifier: Apache-2.0
"""An IMU beside the camera: its gravity, turned into the camera's optical frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import FeltGravity
from objreg_ros.segmenter.gravity.attitude import AttitudeFilter

FindPose = Callable[[str, str], Array | None]  # (camera's frame, IMU's frame) -> T_camera_imu, None where unknown


class Imu(AttitudeFilter):
    """The filter of an IMU, and where that is mounted.

    ``T_camera_imu`` is its pose in the camera's optical frame. Without one, ``find`` is asked for it. What that does
    not know either is the camera's own where both name one frame or none, and of no use where they name two: axes that
    are guessed would turn the scene over.
    """

    def __init__(self, T_camera_imu: Array | None = None, find: FindPose = lambda camera, imu: None) -> None:
        super().__init__()
        self._T_camera_imu, self._find = T_camera_imu, find

    def in_camera(self, felt: FeltGravity, camera_frame: str) -> FeltGravity | None:
        """A direction of `add_imu` in the axes of the camera; None, counted as ``unknown_frame``, where it has none.

        The deviation is the same.
        """
        camera_frame, imu_frame = camera_frame.lstrip("/"), felt.frame_id.lstrip("/")
        T = self._T_camera_imu if self._T_camera_imu is not None else self._find(camera_frame, imu_frame)
        if T is None and imu_frame and camera_frame and imu_frame != camera_frame:
            self.counts["unknown_frame"] += 1
            return None
        gravity = felt.gravity if T is None else T[:3, :3] @ felt.gravity
        return FeltGravity(
            gravity=gravity / np.linalg.norm(gravity),
            gravity_sigma_deg=felt.gravity_sigma_deg,
            stamp_ns=felt.stamp_ns,
            frame_id=camera_frame,
        )
