# SPDX-License-Identifier: Apache-2.0
"""From sessions and ties to where keyframes are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mapper.bent import bent, closure, distances, odometry, square
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.edges import Edges
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.keyframe_graph import KeyframeGraph
from objreg_mapper.optimisation.problem import End, Problem, Solution, Tie
from objreg_mapper.optimisation.solver import Solver
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector

LAPS = square(laps=2)
HALF = len(LAPS) // 2
FIRST, SECOND_LAP = LAPS[:HALF], LAPS[HALF:]
ELSEWHERE = pose(rotation_from_vector(np.array([0.0, 0.0, 0.7])), np.array([5.0, -3.0, 0.0]))
SIDEWAYS = pose(rotation_from_vector(np.array([0.0, 0.0, 1.2])), np.array([0.8, 0.6, 0.0]))
PLAIN = MapperParams(steady_heading=0.0, steady_distance=0.0)


def session(poses: Sequence[Array], params: MapperParams = PLAIN) -> Session:
    made = Session()
    for sample in odometry(list(poses)):
        made.add_pose(sample, params)
    return made


def tie(
    sessions: Sequence[Session], one: End, other: End, true: tuple[Array, Array], error: Array | None = None
) -> Tie:
    """What says of two keyframes where they truly are, or a tie that is off by an error."""
    T = inverse(true[0]) @ true[1] @ (np.eye(4) if error is None else error)
    covariance = np.diag([0.02**2] * 3 + [np.radians(0.5) ** 2] * 3)
    return Tie(one, other, Constraint(T, covariance), closure(LAPS, 0, 1))


def truly(known: Session, true: Sequence[Array]) -> list[Array]:
    """The true poses of the keyframes of a session whose odometry gave one every tenth of a second."""
    return [true[stamp // 100_000_000] for stamp in known.keyframes.stamps_ns]


def problem(
    solver: Solver, sessions: Sequence[Session], ties: Sequence[Tie], params: MapperParams = PLAIN, **parts: Any
) -> Problem:
    counts = tuple(len(one.keyframes) for one in sessions)
    return Problem(solver, sessions, counts, ties, len(ties), frozenset(), params)._replace(**parts)


def solved(sessions: Sequence[Session], ties: Sequence[Tie], params: MapperParams = PLAIN) -> Solution:
    return problem(Solver(), sessions, ties, params).solve()


ONE = session(bent(LAPS))
TRUE = truly(ONE, LAPS)


def within(k1: int, k2: int, error: Array | None = None) -> Tie:
    """A tie of two keyframes of `ONE`."""
    return tie([ONE], End(0, k1), End(0, k2), (TRUE[k1], TRUE[k2]), error)


LAP = next(k for k, stamp in enumerate(ONE.keyframes.stamps_ns) if stamp >= HALF * 100_000_000)
RIGHT = [within(k, k + LAP) for k in range(1, LAP - 2, 3)]


def test_the_keyframes_that_closures_hold_are_nodes_and_the_others_follow_them() -> None:
    solution = solved([ONE], RIGHT)
    (trajectory,) = solution.trajectories
    assert trajectory is not None and solution.kept.all()
    held = {end.keyframe for one in RIGHT for end in (one.end1, one.end2)}
    assert held <= {*trajectory.nodes} and len(trajectory.nodes) < len(ONE.keyframes) == len(trajectory)
    assert distances(list(trajectory.of()), TRUE).max() < 0.25 * distances(ONE.keyframes.poses, TRUE).max()


def test_closures_that_come_one_by_one_make_the_map_that_all_at_once_do() -> None:
    solver = Solver()
    for count in range(1, len(RIGHT) + 1):
        found = problem(solver, [ONE], RIGHT, tie_count=count).solve()
        assert len(found.kept) == count
    at_once = solved([ONE], RIGHT)
    assert found.trajectories[0] is not None and at_once.trajectories[0] is not None
    assert distances(list(found.trajectories[0].of()), list(at_once.trajectories[0].of())).max() < 5e-3


def test_a_map_of_what_was_there_when_it_was_asked_for() -> None:
    solution = problem(Solver(), [ONE], RIGHT, keyframes=(LAP + 3,), tie_count=1).solve()
    assert solution.trajectories[0] is not None and len(solution.trajectories[0]) == LAP + 3


def test_no_session_at_all_is_a_map_of_nothing() -> None:
    solution = solved([Session()], [])
    assert solution.trajectories == (None,) and len(solution.kept) == 0


def test_one_keyframe_stays_where_it_is() -> None:
    (trajectory,) = solved([session([ELSEWHERE])], []).trajectories
    assert trajectory is not None
    np.testing.assert_allclose(trajectory.of(), [ELSEWHERE], atol=1e-9)


def test_a_residual_counts_standard_deviations_and_that_of_a_lie_is_large() -> None:
    solution = solved([ONE], [*RIGHT, within(2, LAP + 2, SIDEWAYS)])
    assert solution.kept.tolist() == [True] * len(RIGHT) + [False]
    assert solution.residuals[:-1].max() < PLAIN.max_residual < solution.residuals[-1]


def test_a_withdrawn_closure_is_as_one_that_never_came() -> None:
    solver, bad = Solver(), [within(2, LAP + 2, pose(np.eye(3), np.array([0.05, 0.0, 0.0]))), *RIGHT]
    assert problem(solver, [ONE], bad).solve().kept.all()
    gone = problem(solver, [ONE], bad, withdrawn=frozenset({0})).solve()
    again = problem(solver, [ONE], bad, withdrawn=frozenset({0})).solve()
    (without,), (trajectory,) = solved([ONE], RIGHT).trajectories, again.trajectories
    assert not gone.kept[0] and not again.kept[0] and again.kept[1:].all()
    assert without is not None and trajectory is not None
    assert distances(list(trajectory.of()), list(without.of())).max() < 5e-3


def test_other_parameters_make_the_map_anew() -> None:
    solver, strict = Solver(), replace(PLAIN, max_residual=1.0)
    off = [*RIGHT, within(2, LAP + 2, pose(np.eye(3), np.array([0.05, 0.0, 0.0])))]
    assert problem(solver, [ONE], off).solve().kept.all()
    assert not problem(solver, [ONE], off, strict).solve().kept[-1]
    assert problem(solver, [ONE], off).solve().kept.all()


# Sessions

TWO = [session(FIRST), session([ELSEWHERE @ T for T in SECOND_LAP])]
TRUE_TWO = [truly(TWO[0], FIRST), truly(TWO[1], SECOND_LAP)]


def across(k1: int, k2: int, error: Array | None = None, swapped: bool = False) -> Tie:
    """A tie of a keyframe of the first session and one of the second."""
    one, other = (End(0, k1), TRUE_TWO[0][k1]), (End(1, k2), TRUE_TWO[1][k2])
    if swapped:
        one, other = other, one
    return tie(TWO, one[0], other[0], (one[1], other[1]), error)


def test_one_closure_ties_no_session_and_two_that_agree_do() -> None:
    one, two = solved(TWO, [across(3, 4)]), solved(TWO, [across(3, 4), across(12, 13, swapped=True)])
    assert one.trajectories[1] is None and np.isnan(one.residuals[0]) and not one.kept[0]
    assert two.trajectories[1] is not None and two.kept.all()
    assert distances(list(two.trajectories[1].of()), TRUE_TWO[1]).max() < 0.02


def test_two_closures_that_disagree_tie_no_session_until_another_agrees_with_one() -> None:
    solver, ties = Solver(), [across(8, 8, SIDEWAYS), across(3, 4)]
    assert problem(solver, TWO, ties).solve().trajectories[1] is None
    solution = problem(solver, TWO, [*ties, across(14, 15)]).solve()
    assert solution.trajectories[1] is not None and solution.kept.tolist() == [False, True, True]
    assert distances(list(solution.trajectories[1].of()), TRUE_TWO[1]).max() < 0.02


def test_what_ties_a_session_is_withdrawn_before_it_did() -> None:
    ties = [across(3, 4), across(12, 13)]
    solution = problem(Solver(), TWO, ties, withdrawn=frozenset({1})).solve()
    assert solution.trajectories[1] is None and np.isnan(solution.residuals[0])


def test_a_session_is_tied_by_way_of_another() -> None:
    third = session([SIDEWAYS @ T for T in FIRST])
    sessions, true = [*TWO, third], [*TRUE_TWO, truly(third, FIRST)]
    by_way = [tie(sessions, End(1, k), End(2, k), (true[1][k], true[2][k])) for k in (2, 9)]
    solution = solved(sessions, [*by_way, across(3, 4), across(12, 13), across(5, 5)])
    assert solution.trajectories[1] is not None
    # what waited is looked at again when more comes of that session
    more = tie(sessions, End(1, 12), End(2, 12), (true[1][12], true[2][12]))
    solution = solved(sessions, [*by_way, across(3, 4), across(12, 13), more])
    assert solution.trajectories[2] is not None and solution.kept.all()
    assert distances(list(solution.trajectories[2].of()), true[2]).max() < 0.05


# What is steadily wrong

WRONG = [within(k, k + 12) for k in range(0, 40, 4)]


def test_what_is_steadily_wrong_is_taken_out_where_that_explains_more() -> None:
    (plain,), (knowing,) = (solved([ONE], WRONG, params).trajectories for params in (PLAIN, MapperParams()))
    assert plain is not None and plain.chain.steady == Steady()
    assert knowing is not None and knowing.chain.steady.heading < -0.01
    assert distances(list(knowing.of()), TRUE)[-1] < 0.5 * distances(list(plain.of()), TRUE)[-1]


def test_odometry_that_is_right_is_left_alone() -> None:
    straight = session(LAPS)
    true = truly(straight, LAPS)
    ties = [tie([straight], End(0, k), End(0, k + 12), (true[k], true[k + 12])) for k in range(0, 40, 4)]
    (trajectory,) = solved([straight], ties, MapperParams()).trajectories
    assert trajectory is not None and trajectory.chain.steady == Steady()


# Closures on which GTSAM fails

POISON = (7, LAP + 7)


def raised_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a method of the graph raise once an edge has the translation of the poison."""
    method, bad = getattr(IncrementalGraph, name), within(*POISON, SIDEWAYS).constraint.T_from_to[:3, 3]

    def failing(graph: IncrementalGraph, *arguments: Any) -> Any:
        for edges in (argument for argument in arguments if isinstance(argument, Edges)):
            if np.isclose(edges.T_1_2[:, :3, 3], bad).all(axis=1).any():
                raise RuntimeError("no solution")
        return method(graph, *arguments)

    monkeypatch.setattr(IncrementalGraph, name, failing)


@pytest.mark.parametrize("name", ["add_edges", "error_covariance"])
def test_a_closure_on_which_gtsam_raises_is_left_out(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    raised_for(name, monkeypatch)
    clean, solver = solved([ONE], RIGHT), Solver()
    ties = [*RIGHT[:2], within(*POISON, SIDEWAYS), *RIGHT[2:]]
    for _ in range(2):
        solution = problem(solver, [ONE], ties).solve()
        assert solution.kept.tolist() == [True, True, False] + [True] * (len(RIGHT) - 2)
    assert solution.trajectories[0] is not None and clean.trajectories[0] is not None
    assert distances(list(solution.trajectories[0].of()), list(clean.trajectories[0].of())).max() < 5e-3


def test_what_is_no_closure_s_fault_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: KeyframeGraph, __: Problem) -> None:
        raise RuntimeError("no solution")

    monkeypatch.setattr(KeyframeGraph, "calibrate", fail)
    with pytest.raises(RuntimeError, match="no solution"):
        solved([ONE], RIGHT)


def test_a_tie_knows_the_closure_that_it_was_made_of() -> None:
    made = within(1, LAP)
    assert isinstance(made.closure, LoopClosure) and Tie(made.end1, made.end2, made.constraint).closure is None
