# SPDX-License-Identifier: Apache-2.0
"""What closures would cost without others is what they do cost in a map without these."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.edges import Edges, edges_of, squared_residuals
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.influence import Influence
from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose

COUNT = 12


def edge(k1: int, k2: int, sideways: float = 0.0, sigma: float = 0.02) -> Edges:
    T = pose(np.eye(3), np.array([float(k2 - k1), sideways, 0.0]))
    return edges_of([(k1, k2, Constraint(T, sigma**2 * np.eye(6)))])


def joined(closures: list[Edges]) -> Edges:
    whole = edges_of(())
    for closure in closures:
        whole = whole.joined(closure)
    return whole


def solved(closures: list[Edges]) -> tuple[IncrementalGraph, Array]:
    graph = IncrementalGraph.begun(np.eye(4))
    places = np.array([pose(np.eye(3), np.array([float(k), 0.0, 0.0])) for k in range(1, COUNT)])
    graph.grow(places, joined([edge(k, k + 1, sigma=0.1) for k in range(COUNT - 1)]))
    graph.add_edges(joined(closures))
    return graph, graph.solve_poses()


@pytest.mark.parametrize("gone", [[], [1], [2, 3], [1, 2, 3]])
def test_the_cost_without_some_is_that_in_a_map_without_them(gone: list[int]) -> None:
    inside = [edge(0, 9, 0.01), edge(3, 11, 0.1), edge(2, 10, -0.05), edge(2, 9, -0.04)]
    newest = edge(1, 8, 0.2)
    graph, poses = solved(inside)
    stated = Influence.of(graph, poses, joined([*inside, newest]), [4, *range(4)]).expected_cost(4, gone)
    without, there = solved([closure for k, closure in enumerate(inside) if k not in gone])
    known = Influence.of(without, there, newest, [0]).expected_cost(0)
    assert stated == pytest.approx(known, rel=0.05)


def test_a_closure_costs_more_where_the_map_knows_better() -> None:
    loose, tight = solved([]), solved([edge(0, 11), edge(1, 10)])
    newest = edge(0, 11, 0.3)
    costs = [Influence.of(graph, poses, newest, [0]).expected_cost(0) for graph, poses in (loose, tight)]
    assert costs[0] < 2.0 < 50.0 < costs[1]


@pytest.mark.parametrize("gone", [[1], [2, 3]])
def test_what_the_rest_costs_less_is_given(gone: list[int]) -> None:
    inside = [edge(0, 9, 0.01), edge(3, 11, 0.1), edge(2, 10, -0.05), edge(2, 9, -0.04)]
    graph, poses = solved(inside)
    stated = Influence.of(graph, poses, joined(inside), list(range(4))).relief(gone)
    rest = [closure for k, closure in enumerate(inside) if k not in gone]
    _, there = solved(rest)
    odometry = joined([edge(k, k + 1, sigma=0.1) for k in range(COUNT - 1)])
    before = squared_residuals(poses, odometry.joined(joined(inside))).sum()
    assert stated == pytest.approx(
        before - squared_residuals(there, odometry.joined(joined(rest))).sum(), rel=0.05, abs=0.1
    )


@pytest.mark.parametrize(("into", "out"), [([], [1]), ([3], []), ([3], [0, 2])])
def test_what_changes_is_known_without_another_look_at_the_graph(into: list[int], out: list[int]) -> None:
    closures = [edge(0, 9, 0.01), edge(3, 11, 0.02), edge(2, 10, -0.01), edge(2, 9, -0.02), edge(1, 8, 0.1)]
    graph, poses = solved(closures[:3])
    before = Influence.of(graph, poses, joined(closures), list(range(5)))
    other, there = solved([closures[k] for k in sorted({0, 1, 2, *into} - {*out})])
    found = before.changed(there, joined(closures), into, out)
    assert found is not None
    known = Influence.of(other, there, joined(closures), [4])
    assert found.expected_cost(4) == pytest.approx(known.expected_cost(4), rel=1e-3)


def test_what_is_not_known_is_not_guessed() -> None:
    closures = joined([edge(0, 9), edge(3, 11), edge(2, 8)])
    graph, poses = solved([edge(0, 9), edge(3, 11)])
    influence = Influence.of(graph, poses, closures, [0, 2])
    assert influence.knows([0, 2]) and not influence.knows([0, 1])
    assert influence.changed(poses, closures, [], [1]) is None


def test_without_what_alone_holds_a_node_nothing_is_known() -> None:
    alone = edge(COUNT - 1, COUNT, sigma=1e-3)
    graph, _ = solved([edge(0, 9)])
    loose = edge(COUNT - 1, COUNT, sigma=1e4)
    graph.grow(pose(np.eye(3), np.array([float(COUNT), 0.0, 0.0]))[None], loose)
    graph.add_edges(alone)
    influence = Influence.of(graph, graph.solve_poses(), alone, [0])
    assert influence.changed(graph.poses(), alone, [], [0]) is None
