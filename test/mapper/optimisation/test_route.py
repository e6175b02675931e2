# SPDX-License-Identifier: Apache-2.0
"""Which keyframes of a session are nodes, and what ties them."""

from __future__ import annotations

import numpy as np

from objreg_mapper.optimisation.chain import STRAIGHT_RAD, Chain
from objreg_mapper.optimisation.route import Route
from objreg_mapper.optimisation.steady import Steady
from objreg_ros.geometry import pose

ROW = np.array([pose(np.eye(3), np.array([float(k), 0.0, 0.0])) for k in range(9)])


def route(variance: float = 1e-6) -> Route:
    chain = Chain.begun(ROW[0], Steady()).extended(ROW, np.full((len(ROW) - 1, 2), variance))
    return Route.begun(chain, 0)


def test_a_keyframe_that_becomes_a_node_is_where_those_beside_it_have_it() -> None:
    known = route().with_node(8, 1)
    new = known.insertion(4, 2, ROW[[0, 8]])
    np.testing.assert_allclose(new.T_map_body, ROW[[4]], atol=1e-9)
    assert new.instead_of == (0, 1) and [row[:2] for row in new.steps] == [(0, 2), (2, 1)]


def test_one_after_the_last_node_takes_the_place_of_no_step() -> None:
    new = route().insertion(8, 1, ROW[[0]])
    np.testing.assert_allclose(new.T_map_body, ROW[[8]], atol=1e-9)
    assert new.instead_of is None and [row[:2] for row in new.steps] == [(0, 1)]


def test_nodes_come_in_the_order_of_their_keyframes() -> None:
    known = route().with_node(8, 1).with_node(4, 2)
    assert known.keyframes == (0, 4, 8) and [row[:2] for row in known.steps()] == [(0, 2), (2, 1)]
    assert known.node_of(4) == 2 and known.missing(4) == [] and known.missing(5) == [5]


def test_where_odometry_turns_too_far_there_are_nodes_on_the_path() -> None:
    assert route().missing(8) == [8]
    assert route(0.4 * STRAIGHT_RAD**2).missing(8) == [2, 4, 6, 8]


def test_it_is_solved_where_its_nodes_are() -> None:
    moved = pose(np.eye(3), np.array([0.0, 1.0, 0.0])) @ ROW
    np.testing.assert_allclose(route().with_node(8, 1).solved(moved[[0, 8]]).of(), moved, atol=1e-9)
