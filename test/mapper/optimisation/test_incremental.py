# SPDX-License-Identifier: Apache-2.0
"""GTSAM's solution against answers that are known."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.optimize import least_squares

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.edges import Edges, edges_of, squared_residuals, whitened_errors
from objreg_mapper.optimisation.incremental import IncrementalGraph, load
from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector


def translation(x: float, y: float = 0.0) -> Array:
    return pose(np.eye(3), np.array([x, y, 0.0]))


def edge(k1: int, k2: int, T: Array, sigma: float = 0.1) -> Edges:
    return edges_of([(k1, k2, Constraint(T, sigma**2 * np.eye(6)))])


def row(count: int = 6) -> IncrementalGraph:
    """Nodes a metre apart, as the steps between them say."""
    graph = IncrementalGraph.begun(np.eye(4))
    steps = edges_of([(k, k + 1, Constraint(translation(1.0), 0.01 * np.eye(6))) for k in range(count - 1)])
    graph.grow(np.array([translation(float(k)) for k in range(1, count)]), steps)
    return graph


def test_two_measurements_meet_where_their_information_says() -> None:
    """The weighted optimum of two conflicting poses far from the identity: it shows the frame of the information."""
    rng = np.random.default_rng(0)
    T_first = pose(rotation_from_vector(np.array([0.4, -1.1, 0.9])), np.array([1.0, -2.0, 0.5]))
    T_second = T_first @ pose(rotation_from_vector(0.01 * rng.normal(size=3)), 0.01 * rng.normal(size=3))
    spreads = [rng.normal(size=(6, 6)) for _ in range(2)]
    said = [Constraint(T, 1e-4 * (A @ A.T + np.eye(6))) for T, A in zip((T_first, T_second), spreads, strict=True)]
    edges = edges_of([(0, 1, constraint) for constraint in said])

    def there(x: Array) -> Array:
        return pose(T_first[:3, :3] @ rotation_from_vector(x[3:]), T_first[:3, 3] + x[:3])

    def residuals(x: Array) -> Array:
        return whitened_errors(np.array([np.eye(4), there(x)]), edges).ravel()

    expected = there(least_squares(residuals, np.zeros(6), xtol=1e-14).x)
    graph = IncrementalGraph.begun(np.eye(4))
    graph.grow(T_first[None], edges)
    graph.solve_poses()
    np.testing.assert_allclose(graph.poses()[1], expected, atol=1e-4)


def test_the_first_node_stays() -> None:
    start = translation(3.0, 4.0)
    graph = IncrementalGraph.begun(start)
    graph.grow(np.eye(4)[None], edge(0, 1, translation(1.0)))
    graph.solve_poses()
    np.testing.assert_allclose(graph.poses(), [start, translation(4.0, 4.0)], atol=1e-6)


def test_what_is_taken_out_leaves_no_trace() -> None:
    graph = row()
    before = graph.poses()
    numbers = graph.add_edges(edge(0, 5, translation(5.0, 1.0), sigma=1e-3))
    graph.solve_poses()
    assert graph.poses()[5][1, 3] == pytest.approx(1.0, abs=0.01)
    graph.remove(numbers)
    graph.solve_poses()
    np.testing.assert_allclose(graph.poses(), before, atol=1e-3)


def test_numbers_distinguish_edges_whether_they_were_solved_or_still_wait() -> None:
    graph = row()
    right = graph.add_edges(edge(0, 5, translation(5.0, 0.2), sigma=1e-3))
    graph.solve_poses()
    wrong = graph.add_edges(edge(0, 4, translation(4.0, 3.0), sigma=1e-3))
    graph.remove(wrong)  # before it was ever solved
    graph.solve_poses()
    assert {*right}.isdisjoint(wrong)
    assert graph.poses()[5][1, 3] == pytest.approx(0.2, abs=0.01)


def test_a_step_gives_way_to_two_with_a_node_between() -> None:
    graph = IncrementalGraph.begun(np.eye(4))
    whole = graph.grow(translation(2.0)[None], edge(0, 1, translation(2.0)))
    halves = edge(0, 2, translation(1.0)).joined(edge(2, 1, translation(1.0)))
    graph.grow(translation(1.0)[None], halves, whole)
    graph.solve_poses()
    np.testing.assert_allclose(graph.poses()[:, 0, 3], [0.0, 2.0, 1.0], atol=1e-6)
    covariance = np.eye(6) + graph.error_covariance(edge(0, 1, translation(2.0)))
    assert covariance[3, 3] == pytest.approx(1.0 + 2.0, rel=0.01)  # its own, and those of both halves


def test_what_is_tried_on_a_copy_does_not_touch_the_graph() -> None:
    graph = row()
    before = graph.poses()
    other = graph.copied()
    other.add_edges(edge(0, 5, translation(5.0, 1.0), sigma=1e-3))
    other.solve_poses()
    np.testing.assert_array_equal(graph.poses(), before)
    assert other.poses()[5][1, 3] == pytest.approx(1.0, abs=0.01)
    graph.grow(translation(6.0)[None], edge(5, 6, translation(1.0)))
    assert len(graph.poses()) == 7 and len(other.poses()) == 6


@pytest.mark.parametrize("sideways", [1e-3, 1e-2])
def test_what_an_edge_is_expected_to_cost_is_what_it_costs(sideways: float) -> None:
    """The rise of the least cost in a graph that is nearly linear."""
    graph, steps = row(), edges_of([(k, k + 1, Constraint(translation(1.0), 0.01 * np.eye(6))) for k in range(5)])
    new = edge(1, 5, translation(4.0, sideways), sigma=0.05)
    error = whitened_errors(graph.poses(), new)[0]
    expected = error @ np.linalg.solve(np.eye(6) + graph.error_covariance(new), error)
    graph.add_edges(new)
    graph.solve_poses()
    assert squared_residuals(graph.poses(), steps.joined(new)).sum() == pytest.approx(expected, rel=0.02)


def test_a_graph_without_an_answer_says_so() -> None:
    graph, spoilt = row(), edge(0, 5, translation(5.0))
    spoilt.T_1_2[0, 0, 3] = np.nan
    graph.add_edges(spoilt)
    with pytest.raises(RuntimeError):
        graph.solve_poses()


def test_where_gtsam_is_not_installed_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gtsam", None)
    with pytest.raises(ValueError, match="expected gtsam, which solves the map, got none: pip install"):
        load()


def test_what_is_known_of_many_edges_is_what_is_known_of_each() -> None:
    graph = row()
    gone = graph.add_edges(edge(0, 5, translation(5.0)))
    graph.add_edges(edge(1, 4, translation(3.0)))
    graph.solve_poses()
    graph.remove(gone)
    asked = [edge(0, 3, translation(3.0)), edge(2, 5, translation(3.0)), edge(1, 4, translation(3.0))]
    known = graph.error_covariance(asked[2].joined(asked[0]).joined(asked[1]))
    for at, one in enumerate((asked[2], asked[0], asked[1])):
        part = slice(6 * at, 6 * at + 6)
        np.testing.assert_allclose(known[part, part], graph.error_covariance(one), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_gtsam_may_eliminate_nodes_in_an_order_of_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = [0, *(1 + rng.permutation(29)).tolist()]
    edges = edges_of([])
    for k in range(1, 30):  # a tree, whose branches have numbers all mixed
        edges = edges.joined(edge(nodes[int(rng.integers(k))], nodes[k], np.eye(4), float(rng.uniform(0.01, 1.0))))
    graph = IncrementalGraph.begun(np.eye(4))
    graph.grow(np.tile(np.eye(4), (29, 1, 1)), edges)
    known = graph.error_covariance(edges)
    np.testing.assert_allclose(known, np.eye(6 * 29), atol=1e-6)
