# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from bridge.trees import SECOND, moved, said, transform
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.travel import Travel
from objreg_ros.geometry import pose


def test_the_odometry_of_tf_comes_at_its_own_stamps_once_the_camera_is_known() -> None:
    tree = FrameTree()
    tree.add_transforms(said(transform("base", "eye", moved(1))))
    travel, samples = Travel(tree), []
    for k in range(4):
        T = pose(np.eye(3), np.array([0.3 * k, 0.0, 0.0]))
        message = said(transform("odom", "base", T, (k + 1) * SECOND), transform("base", "wheel", moved(k), k * SECOND))
        tree.receive_moving(message)
        samples += list(travel.of(message))
        travel.camera = "eye" if k == 1 else travel.camera
    assert [(s.stamp_ns // SECOND, s.frame_id, s.child_frame_id) for s in samples] == [
        (3, "odom", "base"),
        (4, "odom", "base"),
    ]
    assert samples[-1].T_odom_body[0, 3] == 3 * 0.3
