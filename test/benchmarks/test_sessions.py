# SPDX-License-Identifier: Apache-2.0
"""Tests of what an earlier session knew, and of a later one that begins anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from registration.samples import box, frame, moved

from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.truth import Truth

CUP = box("cup", (0.0, 0.0, 1.0))
DRIFT = pose(rotation_from_vector(np.array([0.0, 0.0, 0.3])), np.array([5.0, 1.0, 0.0]))
SECOND = 1_000_000_000


def test_an_object_is_known_where_it_stood_and_a_pose_is_given_by_the_odometry_of_a_moment() -> None:
    from sessions import Earlier

    truth = Truth((k * SECOND // 10, moved(0.1 * k)) for k in range(11))
    shown = [replace(frame(0.1 * k, (CUP,)), T_odom_camera=DRIFT @ moved(0.1 * k)) for k in range(3)]
    earlier = Earlier.of(shown, truth)
    assert earlier.knows(shown[0], moved(0.05)) and not earlier.knows(shown[0], moved(2.0))
    assert np.allclose(earlier.T_map_camera(moved(0.1, 0.2), SECOND // 10), DRIFT @ moved(0.1, 0.2))
    earlier.T_odom_world[0] = np.eye(4)  # as if it had drifted since
    assert np.allclose(earlier.T_map_camera(moved(0.1, 0.2), 0), moved(0.1, 0.2))
    assert np.allclose(earlier.T_map_camera(moved(0.1, 0.2), SECOND // 10), DRIFT @ moved(0.1, 0.2))


def test_a_later_session_begins_long_after_at_an_upright_origin() -> None:
    from sessions import LATER_NS, begun_anew

    level = pose(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([3.0, 4.0, 1.0]))  # looks along x, z is up
    frames = [replace(frame(k, (CUP,)), T_odom_camera=DRIFT @ level @ moved(0.0, 0.0, k)) for k in range(2)]
    first, second = begun_anew(frames)
    assert first.stamp_ns == LATER_NS and first.T_odom_camera is not None and second.T_odom_camera is not None
    assert np.allclose(first.T_odom_camera[:3, 3], 0.0) and np.allclose(first.T_odom_camera[:3, 2], [1, 0, 0])
    assert np.allclose(inverse(first.T_odom_camera) @ second.T_odom_camera, moved(0.0, 0.0, 1.0))


def test_an_object_counts_once_where_one_of_its_label_stood() -> None:
    from sessions import Earlier

    earlier = Earlier([0], [np.eye(4)], [("cup", np.zeros(3)), ("cup", np.array([0.1, 0.0, 0.0]))])
    here, aside = np.array([0.05, 0.0, 0.0]), np.array([0.6, 0.0, 0.0])
    assert earlier.known_among([("cup", here), ("cup", aside), ("book", here)]) == 1
    assert earlier.known_among([]) == 0
