# SPDX-License-Identifier: Apache-2.0
"""Which nodes a graph of keyframes gets, by closures, pictures and sessions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapper.bent import odometry, square
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.keyframe_graph import KeyframeGraph
from objreg_mapper.optimisation.problem import End, Problem, Tie
from objreg_mapper.optimisation.solver import Solver
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.geometry import inverse, pose

PLAIN = MapperParams(picture_translation_error=0.0, picture_rotation_error=0.0)
ASIDE = pose(np.eye(3), np.array([0.0, 2.0, 0.0]))
TRUE = square(laps=2)


def session() -> Session:
    made = Session()
    for one in odometry(TRUE):
        made.add_pose(one, PLAIN)
    return made


ONE = session()


def problem(params: MapperParams = PLAIN) -> Problem:
    sessions = [ONE, ONE]
    return Problem(Solver(), sessions, (len(ONE.keyframes),) * 2, [], 0, frozenset(), params)


def tie(k1: int, k2: int, sessions: tuple[int, int] = (0, 0)) -> Tie:
    T = inverse(ONE.keyframes.poses[k1]) @ ONE.keyframes.poses[k2]
    return Tie(End(sessions[0], k1), End(sessions[1], k2), Constraint(T, 1e-4 * np.eye(6)))


def closed(params: MapperParams, *ties: Tie) -> KeyframeGraph:
    graph = KeyframeGraph(ONE, params.max_residual**2)
    for number, one in enumerate(ties):
        assert graph.close(problem(params), one) == number
    return graph


def test_the_ends_of_closures_are_nodes_and_stay_where_all_agrees() -> None:
    trajectory = closed(PLAIN, tie(2, 9), tie(4, 9)).trajectory(0)
    assert {0, 2, 4, 9} <= {*trajectory.nodes} and len(trajectory) == len(ONE.keyframes)
    np.testing.assert_allclose(trajectory.of(), ONE.keyframes.poses, atol=1e-6)


def test_closures_of_a_keyframe_share_the_error_of_what_it_saw() -> None:
    shared = replace(PLAIN, picture_translation_error=0.01, picture_rotation_error=0.01)
    plain, pictures = (len(closed(params, tie(2, 9), tie(4, 9)).robust.poses) for params in (PLAIN, shared))
    assert pictures == plain + 1


def test_a_session_that_joins_is_where_it_is_put_until_closures_hold_it() -> None:
    graph, chain = closed(PLAIN), Chain.of(ONE, len(ONE.keyframes), Steady())
    assert graph.has(0) and not graph.has(1) and graph.place_of(problem(), End(1, 3)) is None
    T_map_first = ASIDE @ ONE.keyframes.poses[0]
    graph.join(1, T_map_first, chain)
    np.testing.assert_allclose(graph.trajectory(1).of(), ASIDE @ np.array(ONE.keyframes.poses), atol=1e-6)
    for k in (2, 5):
        graph.close(problem(), tie(k, k, (0, 1)))
    np.testing.assert_allclose(graph.trajectory(1).of(), ONE.keyframes.poses, atol=1e-3)
