# SPDX-License-Identifier: Apache-2.0
"""Where closures put a session in the map."""

from __future__ import annotations

import numpy as np

from mapper.bent import odometry, square
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.joining import Vote, place_of, votes_on
from objreg_mapper.optimisation.problem import End, Tie
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector

THERE = pose(rotation_from_vector(np.array([0.0, 0.0, 0.7])), np.array([5.0, -3.0, 0.0]))
ASIDE = pose(np.eye(3), np.array([0.0, 2.0, 0.0]))


def session() -> Session:
    made = Session()
    for one in odometry(square()):
        made.add_pose(one, MapperParams())
    return made


ONE = session()
CHAIN = Chain.of(ONE, len(ONE.keyframes), Steady())


def vote(keyframe: int, error: Array | None = None) -> Vote:
    return Vote(keyframe, THERE @ CHAIN.T_chain_body[keyframe] @ (np.eye(4) if error is None else error))


def test_two_that_agree_place_a_session() -> None:
    T_map_first = place_of(ONE, CHAIN, [vote(2), vote(7)])
    assert T_map_first is not None
    np.testing.assert_allclose(T_map_first, THERE @ CHAIN.T_chain_body[0], atol=1e-9)


def test_one_or_two_that_disagree_do_not() -> None:
    assert place_of(ONE, CHAIN, [vote(2)]) is None
    assert place_of(ONE, CHAIN, [vote(2), vote(7, ASIDE)]) is None


def test_most_votes_count() -> None:
    T_map_first = place_of(ONE, CHAIN, [vote(1, ASIDE), vote(2), vote(7)])
    assert T_map_first is not None
    np.testing.assert_allclose(T_map_first, THERE @ CHAIN.T_chain_body[0], atol=1e-9)


def test_a_closure_votes_in_either_direction_and_only_from_a_place_in_the_map() -> None:
    T_there_here = inverse(ASIDE) @ THERE
    C = 1e-4 * np.eye(6)
    ties = [
        Tie(End(0, 1), End(3, 5), Constraint(T_there_here, C)),
        Tie(End(3, 6), End(0, 1), Constraint(inverse(T_there_here), C)),
        Tie(End(2, 1), End(3, 5), Constraint(T_there_here, C)),
        Tie(End(0, 1), End(2, 5), Constraint(T_there_here, C)),
    ]
    votes = votes_on(3, ties, lambda end: ASIDE if end.session == 0 else None)
    assert [one.keyframe for one in votes] == [5, 6]
    for one in votes:
        np.testing.assert_allclose(one.T_map_body, THERE, atol=1e-9)
