# SPDX-License-Identifier: Apache-2.0
"""What closures say of where odometry has the camera."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import moved

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.registrar.consistency import Standpoint, Statement
from objreg_ros.registrar.localisation.contradiction import (
    Difference,
    Says,
    Tied,
    difference,
    in_agreement,
    says,
    tie_of,
)

T_MAP_ODOM = pose(rotation_from_vector(np.array([0.0, 0.0, 0.4])), np.array([1.0, 2.0, 0.0]))
TIED = Tied(T_MAP_ODOM, 0.05, 2.0)


def statement(metres: float, aside: Array | None = None) -> Statement:
    """Of a camera that has gone so far along x, and is ``aside`` of where odometry has it."""
    source = Standpoint(round(1e9 * (100 + metres)), 5, moved(metres), metres)
    target = Standpoint(round(1e9 * metres), 3, T_MAP_ODOM @ moved(metres + 0.1), metres)
    T_map_source = T_MAP_ODOM @ (np.eye(4) if aside is None else aside) @ moved(metres)
    return Statement(source, target, inverse(target.T_session_camera) @ T_map_source, 100.0, True)


def test_the_tie_of_a_right_closure_is_what_is_believed() -> None:
    assert np.allclose(tie_of(statement(1.0)), T_MAP_ODOM)
    apart = difference(statement(1.0), TIED)
    assert apart == pytest.approx((0.0, 0.0), abs=1e-6) and says(apart, TIED) is Says.HERE


def test_another_place_is_more_than_drift_and_more_than_half_a_metre_away() -> None:
    apart = difference(statement(1.0, moved(0.0, 0.8)), TIED)
    assert apart.metres == pytest.approx(0.8) and says(apart, TIED) is Says.ELSEWHERE
    assert says(apart, TIED._replace(sigma_m=0.3)) is Says.BESIDE
    assert says(Difference(0.0, 0.3), TIED) is Says.BESIDE


def test_another_way_to_face_is_another_place() -> None:
    assert says(Difference(40.0, 0.0), TIED) is Says.ELSEWHERE
    assert says(Difference(10.0, 0.0), TIED) is Says.BESIDE


def test_two_that_agree_are_found_and_one_beside_them_is_not() -> None:
    there, other = moved(0.0, 2.0), moved(3.0, -1.0)
    rivals = [statement(0.0, there), statement(0.2, other), statement(0.4, there)]
    assert in_agreement(rivals) == [rivals[0], rivals[2]]
    assert in_agreement(rivals[:2]) == [] and in_agreement(rivals[:1]) == []


def test_two_of_one_keyframe_do_not_count_as_two() -> None:
    one = statement(0.0, moved(0.0, 2.0))
    assert in_agreement([one, one]) == []
