# SPDX-License-Identifier: Apache-2.0
"""Which closures agree in pairs, on a row of keyframes and in a map."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint, inverted, local_covariance
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.pairwise import PairwiseConsistency, agreeing, in_order, most_agreeing, said
from objreg_mapper.optimisation.problem import End, Tie
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.simulation.walk import WalkParams, walk

COUNT, SIGMA = 30, 0.01
TURN = rotation_from_vector(np.array([0.0, 0.0, 0.2]))
TRUE = [pose(np.linalg.matrix_power(TURN, k), np.array([np.cos(0.2 * k), np.sin(0.2 * k), 0.0])) for k in range(COUNT)]


def chain() -> Chain:
    made = Chain.begun(TRUE[0], Steady()).extended(np.array(TRUE), np.full((COUNT - 1, 2), 1e-5))
    return made


def agrees(one: Tie, other: Tie, chains: tuple[Chain, Chain]) -> bool:
    return bool(agreeing(one, [other], chains)[0])


def tie(k1: int, k2: int, aside: float = 0.0, sessions: tuple[int, int] = (0, 0)) -> Tie:
    T = inverse(TRUE[k1]) @ pose(np.eye(3), np.array([0.0, aside, 0.0])) @ TRUE[k2]
    return Tie(End(sessions[0], k1), End(sessions[1], k2), Constraint(T, SIGMA**2 * np.eye(6)))


def session() -> Session:
    made = Session()
    for k, T in enumerate(TRUE):
        made.keyframes.append(k, T)
    made.variances = [(1e-5, 1e-5)] * (COUNT - 1)
    return made


def brute_force(agree: Array) -> int:
    """The size of the largest set of which each agrees with each."""
    count = len(agree)
    sets = [[k for k in range(count) if bits >> k & 1] for bits in range(1, 1 << count)]
    return max(len(chosen) for chosen in sets if agree[np.ix_(chosen, chosen)].all())


def test_two_that_are_true_agree_and_one_that_is_aside_does_not() -> None:
    chains = chain(), chain()
    assert agrees(tie(0, 20), tie(5, 25), chains) and agrees(tie(5, 25), tie(0, 20), chains)
    assert agrees(tie(0, 20), tie(0, 20), chains)
    assert not agrees(tie(0, 20), tie(5, 25, aside=0.3), chains)


def test_odometry_that_wanders_far_lets_more_agree() -> None:
    loose = Chain.begun(TRUE[0], Steady()).extended(np.array(TRUE), np.full((COUNT - 1, 2), 1e-2))
    assert agrees(tie(0, 20), tie(5, 25, aside=0.3), (loose, loose))


def test_a_cycle_of_true_ties_closes_as_often_as_the_limit_says() -> None:
    rng, chains, count = np.random.default_rng(3), (chain(), chain()), 0
    for _ in range(100):
        stated = []
        for ends in ((2, 18), (7, 26)):
            exact, noise = tie(*ends), SIGMA * rng.standard_normal(6)
            turned = rotation_from_vector(noise[3:]) @ exact.constraint.T_from_to[:3, :3]
            T = pose(turned, exact.constraint.T_from_to[:3, 3] + noise[:3])
            stated.append(exact._replace(constraint=exact.constraint._replace(T_from_to=T)))
        count += agrees(stated[0], stated[1], chains)
    assert count >= 96  # 99 %, and odometry here errs not at all


def test_odometry_is_said_in_both_directions() -> None:
    T, C = said(chain(), np.array([3, 9, 4]), np.array([9, 3, 4]))
    np.testing.assert_allclose(T[0] @ T[1], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(T[2], np.eye(4), atol=1e-12)
    there = chain().between(3, 9)
    np.testing.assert_allclose(C[0], local_covariance(there), atol=1e-12)
    np.testing.assert_allclose(C[1], local_covariance(inverted(there)), atol=1e-12)
    assert not C[2].any()


def test_a_tie_from_a_later_session_is_turned_round() -> None:
    turned = in_order(tie(3, 9, sessions=(1, 0)))
    assert turned.end1 == End(0, 9) and turned.end2 == End(1, 3)
    np.testing.assert_allclose(turned.constraint.T_from_to, inverse(TRUE[9]) @ TRUE[3], atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_the_most_that_agree_are_found(seed: int) -> None:
    upper = np.triu(np.random.default_rng(seed).random((11, 11)) < 0.6, 1)
    agree = upper | upper.T | np.eye(11, dtype=bool)
    found = most_agreeing(agree)
    assert agree[np.ix_(found, found)].all() and len(found) == brute_force(agree)


def test_of_two_thousand_that_agree_all_are_found_in_no_time() -> None:
    begin = perf_counter()
    assert most_agreeing(np.ones((2000, 2000), bool)) == list(range(2000))
    assert perf_counter() - begin < 5.0, "s; with all pairs counted anew for each, it is half a minute"


def test_none_agree_of_none() -> None:
    assert most_agreeing(np.zeros((0, 0), bool)) == []


def test_lies_are_outside_and_come_in_when_more_speak_for_them() -> None:
    chains, known = {0: Chain.of(session(), COUNT, Steady())}, PairwiseConsistency()
    stated = [tie(0, 20), tie(1, 21, aside=1.0), tie(2, 22)]
    assert known.inconsistent(stated, chains) == {1}
    stated += [tie(k, 20 + k, aside=1.0) for k in (3, 4, 5)]
    assert known.inconsistent(stated, chains) == {0, 2}


def test_closures_between_other_sessions_say_nothing_of_these() -> None:
    chains = dict.fromkeys((0, 1), Chain.of(session(), COUNT, Steady()))
    stated = [tie(0, 20), tie(2, 22), tie(3, 9, aside=1.0, sessions=(1, 0)), tie(4, 10, aside=1.0, sessions=(1, 0))]
    assert PairwiseConsistency().inconsistent(stated, chains) == frozenset()


def test_a_map_with_it_leaves_out_lies_and_is_as_one_without_where_there_are_none() -> None:
    walked = walk(WalkParams(poses=120, closures=20, false_share=0.2, lie_m=(0.5, 3.0)), 5)
    graphs = {}
    for switched in (False, True):
        graph = PoseGraph(MapperParams(pairwise_consistency=switched))
        for odometry in walked.odometry:
            graph.add_odometry(odometry)
        for k, (closure, false) in enumerate(zip(walked.closures, walked.is_false.tolist(), strict=True)):
            if switched or not false:
                graph.add_closure(closure)
            if k % 5 == 0:
                graph.optimise()
        graph.optimise()
        graphs[switched] = graph
    lies = {closure.to_ns for closure, false in zip(walked.closures, walked.is_false, strict=True) if false}
    assert lies and lies <= {closure.to_ns for closure in graphs[True].optimise().pruned}
    apart = [
        np.linalg.norm(a[:3, 3] - b[:3, 3]) for (_, a), (_, b) in zip(*(g.path() for g in graphs.values()), strict=True)
    ]
    assert max(apart) < 0.1
