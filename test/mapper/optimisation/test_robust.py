# SPDX-License-Identifier: Apache-2.0
"""Which closures are believed, whatever came first."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from weakref import ReferenceType, ref

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.edges import Edges, edges_of, squared_residuals
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.influence import Influence
from objreg_mapper.optimisation.robust import RobustGraph
from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector

COUNT = 12
LIMIT = 4.0**2
STEP = 0.02  # m and rad, one sigma
SIDEWAYS = [0.0, 0.0, 0.0, 0.5, 0.45, -0.6]  # m: how false random closures are
RIGHT = [(0, 9), (1, 10), (0, 11), (2, 8), (3, 11)]


def translation(x: float, y: float = 0.0) -> Array:
    return pose(np.eye(3), np.array([x, y, 0.0]))


def edge(k1: int, k2: int, T: Array, sigma: float = 0.02) -> Edges:
    return edges_of([(k1, k2, Constraint(T, sigma**2 * np.eye(6)))])


def right(k1: int, k2: int) -> Edges:
    return edge(k1, k2, translation(float(k2 - k1)))


def lie(k1: int, k2: int, sideways: float, sigma: float = 0.02) -> Edges:
    return edge(k1, k2, translation(float(k2 - k1), sideways), sigma)


def steps(count: int = COUNT, sigma: float = STEP) -> Edges:
    return edges_of([(k, k + 1, Constraint(translation(1.0), sigma**2 * np.eye(6))) for k in range(count - 1)])


def row(count: int = COUNT, sigma: float = STEP) -> RobustGraph:
    """Nodes a metre apart, as the steps between them say."""
    graph = RobustGraph(np.eye(4), LIMIT)
    graph.grow(np.array([translation(float(k)) for k in range(1, count)]), steps(count, sigma))
    return graph


def closed(closures: Iterable[Edges]) -> RobustGraph:
    graph = row()
    for closure in closures:
        graph.close(closure)
    return graph


def apart(graph: RobustGraph, other: RobustGraph) -> float:
    return float(np.linalg.norm(graph.poses[:, :3, 3] - other.poses[:, :3, 3], axis=1).max())


def truncated(graph: RobustGraph) -> float:
    residuals = squared_residuals(graph.poses, graph.closures)
    return float(squared_residuals(graph.poses, graph.steps).sum() + np.minimum(residuals, LIMIT).sum())


@pytest.mark.parametrize(("sigmas", "kept"), [(3.9, True), (4.1, False)])
def test_a_closure_is_kept_up_to_the_limit_in_its_standard_deviations(sigmas: float, kept: bool) -> None:
    graph = row(2, 1e-4)
    graph.close(lie(0, 1, 0.1 * sigmas, sigma=0.1))
    assert graph.kept.tolist() == [kept]
    assert graph.residuals == pytest.approx([sigmas**2], rel=1e-3)
    assert graph.cost == pytest.approx(min(sigmas**2, LIMIT), rel=1e-3)


def test_closures_that_agree_share_the_error_of_the_steps() -> None:
    bend = pose(rotation_from_vector(np.array([0.0, 0.0, 0.02])), np.zeros(3))
    said = [edge(k1, k2, translation(float(k2 - k1)) @ bend) for k1, k2 in RIGHT]
    graph = closed(said)
    assert graph.kept.all() and graph.cost == pytest.approx(truncated(graph), rel=1e-6)


@pytest.mark.parametrize("sideways", [0.5, -3.0, 1e9])
@pytest.mark.parametrize("at", [0, 2, 5])
def test_a_lie_among_true_ones_leaves_no_trace_wherever_it_comes(at: int, sideways: float) -> None:
    true = [right(*ends) for ends in RIGHT]
    graph = closed([*true[:at], lie(0, 10, sideways, sigma=1e-4), *true[at:]])
    assert np.flatnonzero(~graph.kept).tolist() == [at]
    assert apart(graph, closed(true)) < 2e-3


def test_a_lie_that_came_first_is_believed_until_true_ones_overrule_it() -> None:
    graph = row()
    graph.close(lie(0, 10, 0.5, sigma=1e-3))
    assert graph.kept.tolist() == [True] and graph.poses[10, 1, 3] == pytest.approx(0.5, abs=0.05)
    for ends in RIGHT:
        graph.close(right(*ends))
    assert graph.kept.tolist() == [False] + [True] * len(RIGHT)
    assert apart(graph, closed(right(*ends) for ends in RIGHT)) < 2e-3


@pytest.mark.parametrize("first", [True, False])
def test_lies_that_agree_give_way_to_more_that_are_true(first: bool) -> None:
    lies, true = [lie(0, 10, 0.5), lie(1, 9, 0.5)], [right(*ends) for ends in RIGHT]
    graph = closed([*lies, *true] if first else [*true, *lies])
    assert graph.kept.tolist() == ([False] * 2 + [True] * 5 if first else [True] * 5 + [False] * 2)
    assert apart(graph, closed(true)) < 2e-3


def test_what_one_closure_cannot_turn_two_that_agree_are_looked_at_for() -> None:
    graph = closed([right(*ends) for ends in RIGHT] + [lie(0, 10, 30.0), lie(1, 9, 30.0), lie(1, 9, 35.0)])
    assert not graph.kept[5:].any()
    assert [graph._is_agreed(k) for k in (5, 6, 7)] == [True, True, False]


def test_what_was_left_out_in_vain_is_left_out_again_only_if_more_is_expected(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = list[tuple[int, ...]]()
    leave_out = RobustGraph._leave_out

    def counted(graph: RobustGraph, numbers: list[int], known: Any) -> None:
        tried.append(tuple(numbers))
        leave_out(graph, numbers, known)

    monkeypatch.setattr(RobustGraph, "_leave_out", counted)
    graph = closed([right(*ends) for ends in RIGHT])
    monkeypatch.setattr(Influence, "relief", lambda influence, gone: 1.5 * LIMIT * len(gone))
    for k in range(3):
        graph.close(lie(0, 10, 30.0 + 20.0 * k))
    assert tried and len(set(tried)) == len(tried)
    monkeypatch.setattr(Influence, "relief", lambda influence, gone: 3.0 * LIMIT * len(gone))
    graph.close(lie(0, 10, 100.0))
    assert len(set(tried)) < len(tried)
    assert graph.kept.tolist() == [True] * 5 + [False] * 4


def test_two_graphs_take_memory_at_once_however_many_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    made, alive = list[ReferenceType[IncrementalGraph]](), list[int]()
    begin, solve = IncrementalGraph.__init__, IncrementalGraph.solve_poses

    def counted(graph: IncrementalGraph, *given: Any, **named: Any) -> None:
        made.append(ref(graph))
        begin(graph, *given, **named)

    def looked_at(graph: IncrementalGraph) -> Array:
        alive.append(sum(one() is not None for one in made))
        return solve(graph)

    monkeypatch.setattr(IncrementalGraph, "__init__", counted)
    monkeypatch.setattr(IncrementalGraph, "solve_poses", looked_at)
    rng = np.random.default_rng(9)
    said = [(a := int(rng.integers(0, 6)), int(rng.integers(a + 3, COUNT)), rng.choice(SIDEWAYS)) for _ in range(10)]
    graph = closed(lie(*one) for one in said)
    assert 0 < np.count_nonzero(graph.kept) < len(said)
    assert len(made) > 5 and max(alive) == 2


def test_the_expected_cost_is_the_rise_of_the_cost() -> None:
    graph = closed([right(0, 9)])
    before = graph.cost
    graph.close(lie(2, 10, 0.3))
    assert graph.kept.all()
    assert graph.cost - before == pytest.approx(graph._expected[-1], rel=0.02)


def test_a_lie_that_came_first_and_fitted_gives_way_to_what_is_true() -> None:
    graph = closed([lie(0, 10, 1.2), right(0, 9), right(1, 10), right(2, 11)])
    assert graph.kept.tolist() == [False, True, True, True]


def test_no_closure_costs_more_than_the_limit() -> None:
    graph, cost = row(), 0.0
    for closure in (lie(0, 10, 0.5), right(0, 9), right(1, 11), lie(3, 9, -2.0), right(2, 10)):
        graph.close(closure)
        assert graph.cost <= cost + LIMIT + 1e-6
        cost = graph.cost
        assert cost == pytest.approx(truncated(graph), rel=1e-6, abs=1e-6)


def test_a_closure_that_is_withdrawn_stays_out() -> None:
    graph = closed([right(0, 9), lie(1, 10, 0.05)])
    assert graph.kept.all()
    graph.withdraw(1)
    assert graph.kept.tolist() == [True, False] and apart(graph, closed([right(0, 9)])) < 2e-3
    graph.close(lie(2, 11, 0.05))
    assert graph.kept.tolist() == [True, False, True]


def test_a_lie_that_is_withdrawn_lets_those_in_that_it_kept_out() -> None:
    graph = closed([lie(0, 10, 0.5, sigma=1e-3), right(0, 11)])
    assert graph.kept.sum() == 1
    graph.withdraw(int(np.flatnonzero(graph.kept)[0]))
    assert graph.kept.sum() == 1


def test_one_that_is_withdrawn_while_it_is_out_stays_out() -> None:
    graph = closed([*(right(*ends) for ends in RIGHT), lie(0, 10, 0.5)])
    before = graph.poses.copy()
    graph.withdraw(5)
    np.testing.assert_array_equal(graph.poses, before)
    assert not graph.kept[5]


def test_a_node_in_the_middle_of_a_step_leaves_the_map() -> None:
    graph = RobustGraph(np.eye(4), LIMIT)
    whole = edges_of([(0, 1, Constraint(translation(2.0), 2 * STEP**2 * np.eye(6)))])
    graph.grow(translation(2.0)[None], whole)
    graph.close(edge(0, 1, translation(2.06)))
    cost, ends = graph.cost, graph.poses.copy()
    middle = (ends[0, 0, 3] + ends[1, 0, 3]) / 2
    halves = edges_of([(k1, k2, Constraint(translation(1.0), STEP**2 * np.eye(6))) for k1, k2 in ((0, 2), (2, 1))])
    graph.grow(translation(middle)[None], halves, (0, 1))
    graph.close(edge(0, 2, translation(middle), sigma=1.0))
    assert len(graph.steps) == 2
    np.testing.assert_allclose(graph.poses[:2], ends, atol=2e-3)
    assert graph.cost == pytest.approx(cost, rel=0.05)


def test_another_graph_of_the_nodes_believes_the_same() -> None:
    said = [*(right(*ends) for ends in RIGHT), lie(0, 10, 0.5), lie(2, 9, 0.01)]
    graph, other = closed(said), row()
    graph.withdraw(6)
    other.believe(graph.belief())
    assert other.kept.tolist() == graph.kept.tolist() and apart(graph, other) < 2e-3
    other.close(right(3, 10))
    assert other.kept.tolist() == [*graph.kept.tolist(), True]


def test_what_was_withdrawn_is_believed_again_once_it_is_admitted() -> None:
    graph = closed([right(0, 9), right(1, 10)])
    graph.withdraw(0)
    assert graph.kept.tolist() == [False, True]
    graph.admit(0)
    assert graph.kept.tolist() == [True, True] and graph.left_out == []


def test_a_closure_with_which_there_is_no_solution_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    settle, add = IncrementalGraph.solve_poses, IncrementalGraph.add_edges

    def poisoned(graph: IncrementalGraph, edges: Edges) -> list[int]:
        graph.poison = bool((edges.k1 == 4).any())  # type: ignore[attr-defined]
        return add(graph, edges)

    def failing(graph: IncrementalGraph) -> Array:
        if getattr(graph, "poison", False):
            raise RuntimeError("no solution")
        return settle(graph)

    monkeypatch.setattr(IncrementalGraph, "add_edges", poisoned)
    monkeypatch.setattr(IncrementalGraph, "solve_poses", failing)
    graph = closed([right(0, 9), lie(4, 11, 1.5), right(1, 10)])
    assert graph.kept.tolist() == [True, False, True]
    assert np.isfinite(graph.cost) and np.isfinite(graph.poses).all()
    with pytest.raises(RuntimeError, match="no solution"):  # of one that fits, for which nothing was copied
        closed([right(0, 9), right(4, 11)])
