# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, Odometry
from objreg_ros.geometry import inverse, inverses
from objreg_ros.plausibility.odometry_fit import find_shift, likeness
from objreg_ros.plausibility.odometry_track import OdometryTrack
from plausibility.spans import STEP_NS, path
from plausibility.test_hand_eye import MOUNT, motions

CAMERA_PATH = path(120, seed=9)


def asked(T_odom_body: Array, later_s: float) -> OdometryTrack:
    """An odometry whose stamps are so much later than the camera's."""
    track = OdometryTrack()
    for k, T in enumerate(T_odom_body):
        track.add(Odometry(T_odom_body=T, stamp_ns=k * STEP_NS + round(1e9 * later_s)))
    return track


def shift_of(track: OdometryTrack, first: int = 40, count: int = 20) -> float | None:
    """The shift that is found of the spans that begin with the one of a number."""
    T_camera = inverses(CAMERA_PATH[:-1]) @ CAMERA_PATH[1:]
    begins = STEP_NS * np.arange(first, first + count)

    def at(seconds: float) -> tuple[Array, Array]:
        ends = [track.at(begins + step + round(1e9 * seconds)) for step in (0, STEP_NS)]
        return inverses(ends[0][0]) @ ends[1][0], ends[0][1] & ends[1][1]

    found = find_shift(at, T_camera[first : first + count])
    return None if found is None else found.seconds


def test_turns_of_one_body_are_alike_under_any_mount_and_those_of_two_are_not() -> None:
    of_body, of_camera = motions(path(25), MOUNT)
    assert likeness(of_body, of_camera).is_alike
    assert likeness(of_body, of_camera, MOUNT[:3, :3]).share == 1.0
    _, of_other = motions(path(25, seed=4), MOUNT)
    assert likeness(of_body, of_other).is_unlike


def test_few_turns_and_none_say_nothing() -> None:
    of_body, of_camera = motions(path(4), MOUNT)
    assert not likeness(of_body, of_camera).is_alike and not likeness(of_body, of_camera).is_unlike
    assert likeness(of_body[:0], of_camera[:0]).turns == 0
    resting = np.broadcast_to(np.eye(4), (9, 4, 4))
    assert likeness(resting, resting).turns == 0


def test_the_shift_of_a_clock_is_found_within_a_frame() -> None:
    T_body = CAMERA_PATH @ inverse(MOUNT)
    for seconds in (7.3, -4.1):
        found = shift_of(asked(T_body, seconds))
        assert found is not None and abs(found - seconds) < 0.1


def test_no_shift_is_found_of_another_robot_or_of_a_clock_that_is_right() -> None:
    assert shift_of(asked(path(120, seed=10), 0.0)) is None
    assert shift_of(asked(CAMERA_PATH @ inverse(MOUNT), 0.0)) is None
