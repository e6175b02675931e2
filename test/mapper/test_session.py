# SPDX-License-Identifier: Apache-2.0
"""What a session remembers of its odometry."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from objreg_mapper.constraint import wandering
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session, stacked
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse, pose, rotation_from_vector

from .bent import SECOND, odometry, square

PARAMS = MapperParams(keyframe_translation=0.5, keyframe_rotation=15.0)
TRUE = square()


def session_of(poses: list[Array], stamps_s: list[float] | None = None) -> Session:
    session = Session()
    for k, sample in enumerate(odometry(poses)):
        stamp_ns = sample.stamp_ns if stamps_s is None else round(stamps_s[k] * SECOND)
        session.add_pose(Odometry(T_odom_body=sample.T_odom_body, stamp_ns=stamp_ns), PARAMS)
    return session


def straight(*metres: float) -> list[Array]:
    return [pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in metres]


def test_the_first_pose_is_a_keyframe_and_then_those_that_are_far_enough_on() -> None:
    session = Session()
    samples = odometry(straight(0.0, 0.3, 0.5, 0.9, 1.1))
    assert [session.add_pose(sample, PARAMS) for sample in samples] == [True, False, True, False, True]
    assert session.keyframes.stamps_ns == [samples[k].stamp_ns for k in (0, 2, 4)]


def test_keyframes_are_odometry_s_own_poses_to_the_last_digit() -> None:
    session, poses = session_of(TRUE), {sample.stamp_ns: sample.T_odom_body for sample in odometry(TRUE)}
    for stamp, T in session.keyframes:
        np.testing.assert_array_equal(T, poses[stamp])
        np.testing.assert_array_equal(session.odometry.at(stamp), poses[stamp])


def test_a_step_is_the_motion_between_two_keyframes_and_as_sure_as_its_way_is_short() -> None:
    session = session_of(TRUE)
    assert len(session.variances) == len(session.keyframes) - 1 > 5
    for k, (a, b) in enumerate(pairwise(session.keyframes.poses), 1):
        step = session.step(k)
        np.testing.assert_allclose(step.T_from_to, inverse(a) @ b, atol=1e-12)
        np.testing.assert_allclose(step.covariance, wandering(inverse(a) @ b, PARAMS.odometry_sigmas), rtol=1e-9)


def test_a_way_is_as_long_one_way_as_the_other() -> None:
    session = session_of(straight(0.0, 0.5, 1.0, 1.5, 1.0, 0.5))
    assert session.path_m(0, 5) == session.path_m(5, 0) == pytest.approx(2.5)
    assert session.path_m(2, 3) == pytest.approx(0.5) and session.path_m(3, 3) == 0.0


def test_after_a_silence_the_next_keyframe_may_be_anywhere() -> None:
    session = session_of(straight(0.0, 0.5, 1.0, 1.5), [0.0, 0.1, 20.1, 20.2])
    assert session.silent_s(0, 1) == 0.0 and session.silent_s(3, 0) == pytest.approx(20.0)
    silent = np.sqrt(session.variances[1])
    assert silent[0] >= 20.0 * PARAMS.max_speed and silent[1] >= np.pi
    assert max(session.variances[0] + session.variances[2]) < 1e-3


def test_it_covers_the_time_of_its_odometry_and_no_silence() -> None:
    session = session_of(straight(0.0, 0.5, 1.0), [1.0, 1.1, 20.0])
    assert [session.covers(round(s * SECOND)) for s in (0.9, 1.05, 10.0, 20.0, 20.1)] == [
        False,
        True,
        False,
        True,
        False,
    ]


def test_time_that_runs_back_is_refused_and_changes_nothing() -> None:
    session = session_of(straight(0.0, 0.5))
    with pytest.raises(ValueError, match="expected a stamp after"):
        session.add_pose(Odometry(T_odom_body=straight(3.0)[0], stamp_ns=0), PARAMS)
    assert len(session.keyframes) == 2 and len(session.variances) == 1


def test_a_turn_on_the_spot_is_a_keyframe_with_a_way_of_no_length() -> None:
    turns = [pose(rotation_from_vector(np.radians([0.0, 0.0, turn])), np.zeros(3)) for turn in (0.0, 14.0, 16.0)]
    session = session_of(turns)
    assert len(session.keyframes) == 2 and session.path_m(0, 1) == 0.0 and min(session.variances[0]) > 0.0


def test_no_poses_are_a_stack_of_none() -> None:
    assert stacked([]).shape == (0, 4, 4) and stacked(TRUE[:3]).shape == (3, 4, 4)


def test_a_session_of_arrays_is_over_and_one_that_goes_on_is_ahead_of_what_it_has_yet_to_come_to() -> None:
    session = session_of(straight(0.0, 0.5), [1.0, 1.1])
    assert [session.is_ahead(round(s * SECOND)) for s in (0.9, 1.05, 1.2)] == [False, False, True]
    assert Session("a").is_ahead(0) and not session.is_over and Session.of_arrays(session.arrays()).is_over
