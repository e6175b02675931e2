# SPDX-License-Identifier: Apache-2.0
"""What a closure says of two keyframes, how well it may be known, and what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapper.bent import closure, odometry, square
from objreg_mapper.closure_constraint import LEAST_SIGMAS, SLACK_M, VAGUEST, ImplausibleError, constraint_of
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.problem import End
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose

TRUE, PARAMS = square(), MapperParams()


def session() -> Session:
    made = Session()
    for one in odometry(TRUE):
        made.add_pose(one, PARAMS)
    return made


ONE = session()
ENDS = End(0, 1), End(0, len(ONE.keyframes) - 2)
STEPS = tuple(ONE.keyframes.stamps_ns[end.keyframe] // 100_000_000 for end in ENDS)
RIGHT = closure(TRUE, *STEPS)


def said(one: LoopClosure, ends: tuple[End, End] = ENDS) -> Constraint:
    return constraint_of(one, ends, [ONE, ONE, session()], None, PARAMS)


def far(metres: float) -> LoopClosure:
    return replace(RIGHT, T_from_to=pose(np.eye(3), np.array([metres, 0.0, 0.0])))


def test_it_is_what_the_closure_says_at_the_stamps_of_keyframes() -> None:
    np.testing.assert_allclose(said(RIGHT).T_from_to, inverse(TRUE[STEPS[0]]) @ TRUE[STEPS[1]], atol=1e-6)


def test_the_camera_is_where_its_robot_and_frame_have_it() -> None:
    T_body_camera = pose(np.eye(3), np.array([0.2, 0.0, 0.3]))
    asked = []

    def mounting(robot: str, frame_id: str) -> np.ndarray:
        asked.append((robot, frame_id))
        return T_body_camera

    constraint = constraint_of(RIGHT, ENDS, [ONE], mounting, PARAMS)
    expected = T_body_camera @ RIGHT.T_from_to @ inverse(T_body_camera)
    np.testing.assert_allclose(constraint.T_from_to, expected, atol=1e-6)
    assert asked == [("", RIGHT.from_frame_id), ("", RIGHT.to_frame_id)]


def test_no_constraint_knows_better_than_the_least_sigmas() -> None:
    C = said(replace(RIGHT, covariance=1e-16 * np.eye(6))).covariance
    least = np.repeat(LEAST_SIGMAS, 3)
    assert np.linalg.eigvalsh(C / np.outer(least, least)).min() == pytest.approx(1.0)


def test_one_that_knows_nothing_is_refused() -> None:
    with pytest.raises(ImplausibleError, match="expected variances of at most"):
        said(replace(RIGHT, covariance=10.0 * VAGUEST * np.eye(6)))


def test_one_that_leads_farther_than_odometry_went_is_refused_within_a_session_alone() -> None:
    most = SLACK_M + PARAMS.max_stretch * ONE.path_m(ENDS[0].keyframe, ENDS[1].keyframe)
    assert said(far(0.99 * most)) is not None
    with pytest.raises(ImplausibleError, match="as odometry went"):
        said(far(1.01 * most))
    between = ENDS[0], End(2, ENDS[1].keyframe)
    assert said(far(1.01 * most), between) is not None
