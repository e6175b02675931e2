# SPDX-License-Identifier: Apache-2.0
"""From sessions and the closures between their keyframes to the keyframes' poses in one map."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.joining import place_of, votes_on
from objreg_mapper.optimisation.keyframe_graph import KeyframeGraph
from objreg_mapper.optimisation.problem import Problem, Solution
from objreg_mapper.optimisation.spare_memory import give_back
from objreg_mapper.optimisation.steady import Steady
from objreg_ros.data.checked import Array

GROWTH = 1.2  # so many times the closures there were, and what is steady is looked at again


class UnsolvableError(Exception):
    """GTSAM finds no solution with a closure."""

    def __init__(self, number: int) -> None:
        super().__init__(f"expected a solution with closure {number}, got none")
        self.number = number


class Solver:
    """Solves the problems of one `PoseGraph`, each from where the one before ended. Not for two threads at once."""

    def __init__(self) -> None:
        self._unsolvable = frozenset[int]()  # ties
        self._growing: GrowingMap | None = None

    def solve(self, problem: Problem) -> Solution:
        """See `Problem.solve`. A closure with which GTSAM finds no solution is left out for good."""
        if not problem.keyframes[0]:
            return _unplaced(problem)
        while True:
            try:
                return self._map_of(problem).solved(problem)
            except UnsolvableError as error:
                self._unsolvable |= {error.number}
                self._growing = None

    def _map_of(self, problem: Problem) -> GrowingMap:
        """The map that grows, or one begun anew where a problem differs by more than what was added."""
        if self._growing is None or not self._growing.goes_on(problem):
            self._growing = GrowingMap(problem, self._unsolvable)
        return self._growing


def _unplaced(problem: Problem) -> Solution:
    """That of a problem whose first session has no keyframe, so that there is no map."""
    residuals = np.full(problem.tie_count, np.nan)
    residuals[list(problem.left_out)] = np.inf
    return Solution((None,) * len(problem.keyframes), np.zeros(problem.tie_count, bool), residuals)


class GrowingMap:
    """The map of problems of which each adds to the one before it; ``unsolvable`` ties are never taken in."""

    def __init__(self, problem: Problem, unsolvable: frozenset[int]) -> None:
        self._params, self._unsolvable = problem.params, unsolvable
        self.graph = KeyframeGraph(problem.sessions[0], problem.limit)
        self._taken = 0  # ties
        self._numbers: dict[int, int] = {}  # of ties in the graph, by theirs
        self._untied: list[int] = []  # ties of sessions that are not in the graph
        self._gone = frozenset[int]()  # ties that are withdrawn
        self._due = 1

    def goes_on(self, problem: Problem) -> bool:
        """Whether it can become the map of a problem.

        Not where a closure between two sessions is withdrawn: one that placed a session did more than to tie it.
        """
        return problem.params == self._params and not any(
            problem.ties[number].end1.session != problem.ties[number].end2.session
            for number in self._newly_gone(problem)
        )

    def _newly_gone(self, problem: Problem) -> frozenset[int]:
        """Ties in the graph that are withdrawn since the problem before."""
        return (problem.left_out - self._gone) & self._numbers.keys()

    def solved(self, problem: Problem) -> Solution:
        """What comes of all that a problem has. `UnsolvableError` where GTSAM fails on a closure that is new."""
        self._withdraw(problem)
        self._take_all(problem, range(self._taken, problem.tie_count))
        self._taken = problem.tie_count
        if len(self._numbers) >= self._due:
            self._due = max(len(self._numbers) + 1, int(GROWTH * len(self._numbers)))
            self.graph.calibrate(problem)
            give_back()  # what the graphs took that were compared
        return self._solution(problem)

    def _withdraw(self, problem: Problem) -> None:
        """Take closures out, and those in again that are withdrawn no more."""
        for number in self._newly_gone(problem):
            self.graph.robust.withdraw(self._numbers[number])
        back, self._gone = self._gone - problem.left_out, problem.left_out
        self._untied = [number for number in self._untied if number not in problem.left_out]
        for number in sorted(back):
            if number in self._numbers:
                self.graph.robust.admit(self._numbers[number])
            elif number < self._taken:
                self._take_all(problem, [number])

    def _take_all(self, problem: Problem, numbers: Iterable[int]) -> None:
        for number in numbers:
            if number not in self._unsolvable and number not in problem.left_out:
                self._take(problem, number)

    def _take(self, problem: Problem, number: int) -> None:
        sessions = {end.session for end in problem.ties[number][:2]}
        away = {session for session in sessions if not self.graph.has(session)}
        try:
            if not away:
                self._numbers[number] = self.graph.close(problem, problem.ties[number])
                return
            self._untied.append(number)
            for session in away:
                self._join(problem, session)
        except (RuntimeError, ValueError) as error:  # GTSAM's, and numpy's of what is no number
            raise UnsolvableError(number) from error

    def _join(self, problem: Problem, session: int) -> None:
        """Take a session into the graph where closures agree on where it is."""
        known, ties = problem.sessions[session], [problem.ties[number] for number in self._untied]
        votes = votes_on(session, ties, lambda end: self.graph.place_of(problem, end))
        chain = Chain.of(known, problem.keyframes[session], Steady())
        T_map_first = place_of(known, chain, votes)
        if T_map_first is not None:
            self.graph.join(session, T_map_first, chain)
            again, self._untied = self._untied, []
            self._take_all(problem, again)

    # What comes of it

    def _solution(self, problem: Problem) -> Solution:
        kept, residuals = np.zeros(problem.tie_count, bool), np.full(problem.tie_count, np.inf)
        numbers, places = list(self._numbers), list(self._numbers.values())
        residuals[self._untied] = np.nan
        kept[numbers] = self.graph.robust.kept[places]
        residuals[numbers] = np.sqrt(self.graph.robust.residuals[places])
        placed = _placed(problem, kept)
        trajectories = [self.graph.trajectory(s) if s in placed else None for s in range(len(problem.keyframes))]
        return Solution(tuple(trajectories), kept, residuals)


def _placed(problem: Problem, kept: Array) -> set[int]:
    """The sessions that are the first, or tied to it by closures that are believed."""
    pairs = {(problem.ties[k].end1.session, problem.ties[k].end2.session) for k in np.flatnonzero(kept).tolist()}
    placed, grown = set[int](), {0}
    while grown:
        placed |= grown
        grown = {b for pair in pairs for a, b in (pair, pair[::-1]) if a in placed} - placed
    return placed
