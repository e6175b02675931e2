# SPDX-License-Identifier: Apache-2.0
"""Closures that are left out before a map is solved."""

from __future__ import annotations

import numpy as np

from mapper.bent import odometry, square
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.doubts import Doubts
from objreg_mapper.optimisation.problem import End, Tie
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.geometry import inverse, pose

BY_ODOMETRY, IN_PAIRS = MapperParams(trust="odometry"), MapperParams(pairwise_consistency=True)


def session() -> Session:
    made = Session()
    for one in odometry(square()):
        made.add_pose(one, MapperParams())
    return made


ONE = session()


def tie(k1: int, k2: int, aside: float = 0.0) -> Tie:
    T = inverse(ONE.keyframes.poses[k1]) @ ONE.keyframes.poses[k2] @ pose(np.eye(3), np.array([0.0, aside, 0.0]))
    return Tie(End(0, k1), End(0, k2), Constraint(T, 1e-4 * np.eye(6)))


RIGHT, FALSE = [tie(1, 8), tie(2, 9), tie(3, 10)], tie(2, 7, aside=30.0)


def test_without_a_parameter_that_says_so_none_is_left_out() -> None:
    assert Doubts().of([*RIGHT, FALSE], [ONE], MapperParams()) == frozenset()


def test_what_odometry_or_the_others_contradict_is_left_out() -> None:
    for params in (BY_ODOMETRY, IN_PAIRS):
        assert Doubts().of([*RIGHT, FALSE], [ONE], params) == {3}


def test_closures_are_judged_as_they_come() -> None:
    doubts = Doubts()
    assert doubts.of(RIGHT, [ONE], BY_ODOMETRY) == frozenset()
    assert doubts.of([*RIGHT, FALSE], [ONE, Session()], BY_ODOMETRY) == {3}
