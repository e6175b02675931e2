# SPDX-License-Identifier: Apache-2.0
"""Which closures can be believed: those with which the truncated squares of all residuals are least.

A closure that is left out costs as much as one at the limit, and no more (Yang et al., "Graduated Non-Convexity for
Robust Spatial Perception", 2020, equation 4). Closures come one by one into a map that those before have made, so the
least is looked for from there: with a closure, without it, with it in the place of those that contradict it, and
without one that was doubtful when it came.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from objreg_mapper.optimisation.edges import Edges, edges_of, squared_residuals
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.influence import Influence
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses

ROUNDS = 5  # most times that closures go in and out until none wants to
LINEAR = 10.0  # a closure that is expected to cost so many limits is not tried: it is not for want of linearity
MOST_DOUBTED, MOST_ALIKE, MOST_RETRIED = 5, 5, 5
LIKELY_RETRIED = 20  # closures that may be among those once some are left out: to know of them at once is cheap
MORE = 0.1  # limits: by how much more must be expected of a trial that has failed, to do it again
NEAR_M = 10.0  # between the ends of two closures that may agree,
AGREEING_M, AGREEING_SHARE = 0.1, 0.05  # and how far they may be from that, with every metre between them


@dataclass(frozen=True, slots=True)
class _State:
    """A solved graph, the factors of closures in it (-1: left out), and what poses, residuals and costs come of it."""

    graph: IncrementalGraph
    factors: Array
    poses: Array
    residuals: Array
    cost: float

    @property
    def kept(self) -> Array:
        return self.factors >= 0


class _Known(NamedTuple):
    """The influence of closures on each other in a state, and which were ``kept (m,)`` in that."""

    influence: Influence
    kept: Array


class Belief(NamedTuple):
    """What a graph holds of its closures, and where it puts its nodes: enough to begin another graph of them.

    ``apart`` is what each closure says to a graph that it is not in, ``expected (m,)`` what each was expected to cost
    when it came. Of those that are ``withdrawn``, by number, none is ever ``kept (m,)``.
    """

    poses: Array
    closures: Edges
    apart: Edges
    expected: Array
    withdrawn: tuple[int, ...]
    kept: Array


class RobustGraph:
    """Nodes, steps of odometry between them, and closures of which some may be false.

    ``limit`` is the squared residual from which on a closure is left out. RuntimeError where GTSAM finds no solution;
    a closure with which it finds none is left out where that shows in time.
    """

    def __init__(self, T_map_first: Array, limit: float) -> None:
        self.limit = limit
        self.steps = self.closures = self._apart = edges_of(())
        self._step_factors = np.zeros(0, int)
        self._withdrawn: tuple[int, ...] = ()  # closures
        self._expected = np.zeros(0)  # what each closure was expected to cost when it came
        self._failed: dict[tuple[int, ...], float] = {}  # what was expected of leaving closures out, in vain
        graph = IncrementalGraph.begun(T_map_first)
        self._state = _State(graph, np.zeros(0, int), graph.poses(), np.zeros(0), 0.0)

    @classmethod
    def believing(cls, belief: Belief, steps: Edges, limit: float) -> RobustGraph:
        """A graph of the same nodes and closures with other steps; closures go in and out until none wants to."""
        graph = cls(belief.poses[0], limit)
        if len(belief.poses) > 1:
            graph.grow(belief.poses[1:], steps)
            graph.believe(belief)
        return graph

    @property
    def poses(self) -> Array:
        """(n, 4, 4) of the nodes."""
        return self._state.poses

    @property
    def kept(self) -> Array:
        """(m,) of bool: the closures that are believed."""
        return self._state.kept

    @property
    def residuals(self) -> Array:
        """(m,): squared, of all closures."""
        return self._state.residuals

    @property
    def cost(self) -> float:
        """The truncated squares of all residuals."""
        return self._state.cost

    def grow(self, poses: Array, steps: Edges, instead_of: tuple[int, int] | None = None) -> None:
        """Add nodes at poses, and the steps that tie them; ``instead_of`` the step between two nodes, if so."""
        graph, out = self._state.graph, list[int]()
        if instead_of is not None:
            gone = (self.steps.k1 == instead_of[0]) & (self.steps.k2 == instead_of[1])
            out = self._step_factors[gone].tolist()
            self.steps, self._step_factors = self.steps.taken(~gone), self._step_factors[~gone]
        self._step_factors = np.append(self._step_factors, graph.grow(poses, steps, out))
        self.steps = self.steps.joined(steps)
        self._state = replace(self._state, poses=np.concatenate([self._state.poses, poses]))

    def belief(self) -> Belief:
        """What it holds now."""
        return self._belief_of(self._state)

    def belief_with(self, number: int) -> Belief:
        """What it would hold with a closure in it that was left out, whatever it costs."""
        return self._belief_of(self._changed(self._state, [number], []))

    def _belief_of(self, state: _State) -> Belief:
        return Belief(state.poses, self.closures, self._apart, self._expected, self._withdrawn, state.kept)

    def believe(self, belief: Belief) -> None:
        """Take in the closures of another graph of these nodes, as it does; then those go in and out that want to."""
        self.closures, self._apart = belief.closures, belief.apart
        self._expected, self._withdrawn = belief.expected, belief.withdrawn
        graph, factors = self._state.graph, np.full(len(belief.closures), -1)
        factors[belief.kept] = graph.add_edges(belief.closures.taken(belief.kept))
        self._state = self._sorted_out(self._weighed(graph, factors))

    def close(self, closure: Edges, apart: Edges | None = None) -> None:
        """Take in one more; `kept` says whether it is believed, and what became of the others.

        ``apart`` is what it says to a graph that it is not in: with the freedom that nodes have which it alone holds.
        """
        expected, newest = self._left_out(closure, apart or closure), len(self.closures) - 1
        if expected <= self.limit:
            self._welcome(closure)
        elif expected < LINEAR * self.limit or self._is_agreed(newest):
            self._improve(self._changed(self._state, [newest], []), stays_in=newest)
        self._improve(self._state)
        if not self.kept[newest]:
            self._doubt(newest)

    def _left_out(self, closure: Edges, apart: Edges) -> float:
        """Note a closure as one that is left out. Returns what it is expected to cost to believe it."""
        self.closures, self._apart = self.closures.joined(closure), self._apart.joined(apart)
        expected = self._expected_cost(self._state, len(self.closures) - 1)
        self._expected = np.append(self._expected, expected)
        self._state = replace(
            self._state,
            factors=np.append(self._state.factors, -1),
            residuals=np.append(self._state.residuals, squared_residuals(self._state.poses, apart)),
            cost=self._state.cost + self.limit,
        )
        return expected

    def _welcome(self, closure: Edges) -> None:
        """Believe the newest closure, which is expected to fit: nothing is tried on a copy, as for those in doubt."""
        without, factors = self._state, self._state.factors.copy()
        factors[-1:] = without.graph.add_edges(closure)
        self._state = self._weighed(without.graph, factors)
        if not self._state.cost <= without.cost:
            self._state = self._changed(self._state, [], [len(factors) - 1])

    @property
    def left_out(self) -> list[int]:
        """The numbers of closures that are not believed and may be."""
        return np.setdiff1d(np.flatnonzero(~self.kept), self._withdrawn).tolist()

    def withdraw(self, number: int) -> None:
        """A closure is left out from now on, whatever it costs."""
        self._withdrawn += (number,)
        if self.kept[number]:
            without = self._changed(self._state, [], [number])
            if not np.isfinite(without.cost):
                raise RuntimeError(f"expected a solution without closure {number}, got none")
            self._state = self._sorted_out(without)
            self._try_again(self._state, ())

    def admit(self, number: int) -> None:
        """A closure that was withdrawn may be believed again."""
        self._withdrawn = tuple(gone for gone in self._withdrawn if gone != number)
        self._improve(self._changed(self._state, [number], []))

    def _take(self, state: _State) -> None:
        """The better one of two."""
        if state.cost < self._state.cost:
            self._state = state

    def _expected_cost(self, state: _State, number: int) -> float:
        """What it will cost to believe a closure, were all of it linear: its error as the map expects it.

        What it costs where the nodes are is more; where that is little already, nothing has to be known of the map.
        """
        cost = float(squared_residuals(state.poses, self.closures.taken(slice(number, number + 1)))[0])
        return cost if cost <= self.limit else self._influence(state, [number]).expected_cost(number)

    def _influence(self, state: _State, numbers: Sequence[int]) -> Influence:
        return Influence.of(state.graph, state.poses, self.closures, numbers)

    def _influence_in(self, state: _State, numbers: Sequence[int], known: _Known | None) -> Influence:
        """That in a state, from what is known of another one if that is enough."""
        if known is not None and known.influence.knows(numbers):
            into, out = state.kept & ~known.kept, ~state.kept & known.kept
            changed = np.flatnonzero(into).tolist(), np.flatnonzero(out).tolist()
            if found := known.influence.changed(state.poses, self.closures, *changed):
                return found
        return self._influence(state, numbers)

    def _is_agreed(self, number: int) -> bool:
        """Whether another closure that is left out says the same."""
        return bool(self._saying_the_same(number)[self.left_out].any())

    def _saying_the_same(self, number: int) -> Array:
        """(m,) of bool: the other closures that say of two places what this one does, as far as the map knows."""
        one, others = self.closures.taken(slice(number, number + 1)), self.closures
        T = inverses(self.poses)
        there = T[one.k1] @ self.poses[others.k1]
        back = T[others.k2] @ self.poses[one.k2]
        apart = inverses(one.T_1_2) @ there @ others.T_1_2 @ back
        ways = np.linalg.norm(there[:, :3, 3], axis=1) + np.linalg.norm(back[:, :3, 3], axis=1)
        near = (ways < NEAR_M) & (np.linalg.norm(apart[:, :3, 3], axis=1) < AGREEING_M + AGREEING_SHARE * ways)
        near[number] = False  # that is itself
        return near

    def _doubt(self, newest: int) -> None:
        """Leave out those that were the most doubtful when they came, one by one, where that is expected to cost less.

        And each with those that say the same: lies that agree hold each other up. In its favour count the newest, and
        those that were left out and say the same as it, as far as they fit then.
        """
        kept, left_out = np.flatnonzero(self.kept), np.flatnonzero(~self.kept)
        voters = np.setdiff1d(left_out[self._saying_the_same(newest)[left_out]], self._withdrawn)[:MOST_ALIKE].tolist()
        suspects = kept[np.argsort(-self._expected[kept])][:MOST_DOUBTED].tolist()
        groups = [[k, *np.flatnonzero(self._saying_the_same(k) & self.kept)[:MOST_ALIKE].tolist()] for k in suspects]
        likely = left_out[np.argsort(self.residuals[left_out])][:LIKELY_RETRIED].tolist()
        numbers = np.unique([newest, *voters, *likely, *chain(*groups)]).tolist()
        known = _Known(self._influence(self._state, numbers), self.kept)
        for gone in chain(*(([group[0]], group) for group in groups)):
            gains = [max(self.limit - known.influence.expected_cost(k, gone), 0.0) for k in (newest, *voters)]
            gain = known.influence.relief(gone) + sum(gains) - self.limit * len(gone)
            if gain > self._needed(gone) and self.kept[gone].all():
                self._leave_out(gone, known)
                if self.kept[gone].all():
                    self._failed[tuple(gone)] = gain
                if self.kept[newest]:
                    return

    def _needed(self, gone: list[int]) -> float:
        """What must be expected of leaving closures out: more than when that was in vain."""
        failed = self._failed.get(tuple(gone))
        return 0.0 if failed is None else failed + MORE * self.limit

    def _leave_out(self, numbers: list[int], known: _Known) -> None:
        """Where all else is better then."""
        self._try_again(self._sorted_out(self._changed(self._state, [], numbers), stays_out=numbers), numbers, known)

    def _try_again(self, state: _State, stays_out: Sequence[int], known: _Known | None = None) -> None:
        """Take a state, or it with a closure back in that fits a map which some less hold; others follow it."""
        self._take(state)
        left_out = np.setdiff1d(np.flatnonzero(~state.kept), [*stays_out, *self._withdrawn])
        again = left_out[np.argsort(state.residuals[left_out])][:MOST_RETRIED].tolist()
        if not again:
            return
        influence = self._influence_in(state, again, known)
        for k in again:
            if not state.kept[k] and influence.expected_cost(k) <= self.limit:
                state = self._changed(state, [k], [])  # the one before takes no memory meanwhile
                state = self._sorted_out(state, stays_out=stays_out)
                influence = self._influence_in(state, again, known)
        self._take(state)

    def _improve(self, state: _State, stays_in: int = -1) -> None:
        """Closures go in and out of a state until none wants to. Take the best of all rounds, if it is better."""
        for _ in range(ROUNDS):
            self._take(state)
            into, out = self._wanting(state, stays_in)
            is_spare = state.graph is not self._state.graph
            tried = self._tried(state, into, out, is_spare) if into or out else None
            if tried is None:
                return
            state = tried
        self._take(state)

    def _sorted_out(self, state: _State, stays_out: Sequence[int] = ()) -> _State:
        """Closures go in and out until none wants to. The best state of all rounds, which is taken if it is better."""
        best = state
        for _ in range(ROUNDS):
            into, out = self._wanting(state, stays_out=stays_out)
            is_spare = state.graph is not best.graph
            tried = self._tried(state, into, out, is_spare) if into or out else None
            if tried is None:
                break
            state = tried
            if state.cost < best.cost:
                best = state
                self._take(best)  # the one before takes no memory any more
        return best

    def _wanting(self, state: _State, stays_in: int = -1, stays_out: Sequence[int] = ()) -> tuple[list[int], list[int]]:
        """The closures that want into a state, and those that want out."""
        out, into = state.kept & (state.residuals > self.limit), ~state.kept & (state.residuals <= self.limit)
        into[[*self._withdrawn, *stays_out]] = False
        if stays_in >= 0:
            out[stays_in] = False
        return np.flatnonzero(into).tolist(), np.flatnonzero(out).tolist()

    def _changed(self, state: _State, into: list[int], out: list[int]) -> _State:
        """With other closures in it; one that costs infinitely where that has no solution."""
        return self._tried(state, into, out) or replace(state, cost=np.inf)

    def _tried(self, state: _State, into: list[int], out: list[int], is_spare: bool = False) -> _State | None:
        """With other closures in it; None where that has no solution. A spare state is of no use any more."""
        factors = state.factors.copy()
        try:
            graph = state.graph if is_spare else state.graph.copied()
            if out:
                graph.remove(factors[out].tolist())
                factors[out] = -1
            if into:
                factors[into] = graph.add_edges(self.closures.taken(np.array(into)))
            return self._weighed(graph, factors)
        except (RuntimeError, ValueError):
            return None

    def _weighed(self, graph: IncrementalGraph, factors: Array) -> _State:
        poses = graph.solve_poses()
        held, apart = squared_residuals(poses, self.closures), squared_residuals(poses, self._apart)
        residuals = np.where(factors >= 0, held, apart)
        cost = squared_residuals(poses, self.steps).sum() + np.where(factors >= 0, residuals, self.limit).sum()
        return _State(graph, factors, poses, residuals, float(cost) if np.isfinite(cost) else np.inf)
