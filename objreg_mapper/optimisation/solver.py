# SPDX-License-Identifier: Apache-2.0
"""From sessions and the closures between their keyframes to the keyframes' poses in one map.

The graph has a node where a closure holds a keyframe, and in between what `Chain` says. What is steadily wrong with
odometry is taken out where that explains as much more as three more numbers must (Schwarz, "Estimating the dimension of
a model", 1978): a few closures that err a little in one direction are no evidence of it.
"""

from __future__ import annotations

from bisect import bisect_left
from copy import copy
from dataclasses import dataclass

import numpy as np

from objreg_mapper.constraint import Constraint, freed, inverted
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.edges import edges_of
from objreg_mapper.optimisation.problem import End, Problem, Solution, SolvedTrajectory
from objreg_mapper.optimisation.robust import RobustGraph
from objreg_mapper.optimisation.steady import Steady, estimate
from objreg_mapper.params import MapperParams
from objreg_mapper.session import stacked
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, inverses

FREEDOMS, FREEDOMS_OF_STEADY = 6, 3  # of a closure, and of what is steadily wrong with an odometry
FEW, MOST_TRIED = 30, 2  # closures with which one that was left out may be right; of those, the newest
ROUNDS = 4  # most times that odometry is corrected
SETTLED = 5e-4  # rad/m and m/m: a change of its steady error that matters no more
GROWTH = 1.2  # so many times the closures there were, and what is steady is looked at again
TIES, MOST_VOTES = 2, 100  # closures that have to agree on where a session is in the map, of the newest so many
AGREEING_M, AGREEING_SHARE = 0.3, 0.05  # how far they may be from that, and with every metre of odometry between them
LOOSE = np.diag(np.repeat([1e4, 10.0], 3) ** 2)  # m and rad: what ties a session that only closures hold


@dataclass(slots=True)
class _Route:
    """A session in the graph: its chain, the keyframes that are nodes in order, and the nodes' numbers there."""

    chain: Chain
    keyframes: list[int]
    nodes: dict[int, int]


class Solver:
    """Solves the problems of one `PoseGraph`, each from where the one before ended. Not for two threads at once."""

    def __init__(self) -> None:
        self._unsolvable: set[int] = set()  # ties
        self._forget(None)

    def _forget(self, params: MapperParams | None) -> None:
        self._params = params
        self._robust: RobustGraph | None = None
        self._routes: dict[int, _Route] = {}
        self._taken = 0  # ties
        self._at: int | None = None  # the tie that is being taken in
        self._numbers: dict[int, int] = {}  # of ties in the graph, by theirs
        self._untied: list[int] = []  # ties of sessions that are not in the graph
        self._tethers: list[tuple[int, int, Constraint]] = []  # what holds pictures to keyframes, and sessions, loosely
        self._held: set[int] = set()  # nodes of keyframes that a closure holds
        self._pictures: dict[int, int] = {}  # nodes by those of their keyframes
        self._gone = frozenset[int]()  # ties that are withdrawn
        self._due = 1

    def solve(self, problem: Problem) -> Solution:
        """See `Problem.solve`. A closure with which GTSAM finds no solution is left out for good."""
        while True:
            try:
                return self._solved(problem)
            except (RuntimeError, ValueError):  # GTSAM's, and numpy's of what is no number
                if self._at is None:
                    raise
                self._unsolvable.add(self._at)
                self._forget(None)

    def _solved(self, problem: Problem) -> Solution:
        if problem.params != self._params:
            self._forget(problem.params)
        if problem.keyframes[0] and self._robust is None:
            self._begin(problem)
        self._withdraw(problem)
        for number in range(self._taken, problem.tie_count):
            self._take(problem, number)
        self._at, self._taken = None, problem.tie_count
        if len(self._numbers) >= self._due:
            self._due = max(len(self._numbers) + 1, int(GROWTH * len(self._numbers)))
            self._calibrate(problem)
        return self._solution(problem)

    def _begin(self, problem: Problem) -> None:
        first = problem.sessions[0].keyframes.poses[0]
        self._robust = RobustGraph(first, problem.params.max_residual**2)
        self._routes[0] = _Route(Chain(first, Steady()), [0], {0: 0})

    # Closures

    def _take(self, problem: Problem, number: int) -> None:
        if number in self._unsolvable or number in problem.left_out:
            return
        self._at, tie = number, problem.ties[number]
        if tie.end1.session in self._routes and tie.end2.session in self._routes:
            self._close(problem, number)
        else:
            self._untied.append(number)
            for session in {tie.end1.session, tie.end2.session} - set(self._routes):
                self._join(problem, session)

    def _close(self, problem: Problem, number: int) -> None:
        assert self._robust is not None
        tie = problem.ties[number]
        nodes = [self._node(problem, end) for end in (tie.end1, tie.end2)]
        sigmas = problem.params.picture_sigmas
        first, second = (node not in self._held or not all(sigmas) for node in nodes)  # it has that error for itself
        k1, k2 = (self._picture(node, sigmas) for node in nodes)
        self._numbers[number] = len(self._robust.closures)
        said, free = freed(tie.constraint, sigmas, (first, second)), freed(tie.constraint, sigmas)
        self._robust.close(edges_of([(k1, k2, said)]), edges_of([(k1, k2, free)]))
        self._held.update(nodes)

    def _node(self, problem: Problem, end: End) -> int:
        """The node of a keyframe, which becomes one if it is none; so do some on the path there from the last."""
        route = self._routes[end.session]
        self._extend(problem, end.session)
        while (between := route.chain.straight_until(route.keyframes[-1])) < end.keyframe:
            self._insert(route, between)
        if end.keyframe not in route.nodes:
            self._insert(route, end.keyframe)
        return route.nodes[end.keyframe]

    def _picture(self, node: int, sigmas: tuple[float, float]) -> int:
        """The node of what a keyframe saw: the keyframe's, but for an error that closures of it share.

        The first closure has that error for itself, as most are the only one of their keyframe.
        """
        assert self._robust is not None
        if node not in self._held or not all(sigmas):
            return node
        if node not in self._pictures:
            self._pictures[node] = len(self._robust.poses)
            same = Constraint(np.eye(4), np.diag(np.repeat(np.square(sigmas), 3)))
            self._tethers.append((node, self._pictures[node], same))
            self._robust.grow(self._robust.poses[[node]], edges_of(self._tethers[-1:]))
        return self._pictures[node]

    def _insert(self, route: _Route, k: int) -> None:
        """A keyframe becomes a node, after the last one or between two."""
        assert self._robust is not None
        node, at = len(self._robust.poses), bisect_left(route.keyframes, k)
        before, after = route.keyframes[at - 1], route.keyframes[at : at + 1]
        steps = [(route.nodes[before], node, route.chain.between(before, k))]
        steps += [(node, route.nodes[b], route.chain.between(k, b)) for b in after]
        places = self._robust.poses[[route.nodes[known] for known in (before, *after)]]
        T_map_body = route.chain.spread((before, *after), places, np.array([k]))
        self._robust.grow(T_map_body, edges_of(steps), (route.nodes[before], route.nodes[after[0]]) if after else None)
        route.keyframes.insert(at, k)
        route.nodes[k] = node

    def _extend(self, problem: Problem, session: int) -> None:
        """Bring the chain to the keyframes that the problem has."""
        route, known = self._routes[session], problem.sessions[session]
        begin, end = len(route.chain), problem.keyframes[session]
        if end > begin:
            poses = stacked(known.keyframes.poses[begin - 1 : end])
            route.chain.extend(poses, np.array(known.variances[begin - 1 : end - 1]))

    def _withdraw(self, problem: Problem) -> None:
        """Take closures out. One that placed a session did more than to tie it, so all is taken in anew without it."""
        gone = set((problem.left_out - self._gone) & self._numbers.keys())
        if any(problem.ties[number].end1.session != problem.ties[number].end2.session for number in gone):
            self._forget(problem.params)
            self._begin(problem)
            gone = set[int]()
        for number in gone:
            assert self._robust is not None
            self._robust.withdraw(self._numbers[number])
        back, self._gone = self._gone - problem.left_out, problem.left_out
        self._untied = [number for number in self._untied if number not in problem.left_out]
        for number in sorted(back):
            self._admit(problem, number)

    def _admit(self, problem: Problem, number: int) -> None:
        """Take in a closure that was left out before."""
        if number in self._numbers:
            assert self._robust is not None
            self._robust.admit(self._numbers[number])
        elif number < self._taken:
            self._take(problem, number)

    # Sessions

    def _join(self, problem: Problem, session: int) -> None:
        """Take a session into the graph where closures agree on where it is."""
        found = self._place_of(problem, session)
        if found is None:
            return
        assert self._robust is not None
        T_map_first, chain = found
        node = len(self._robust.poses)
        self._tethers.append((0, node, Constraint(inverse(self._robust.poses[0]) @ T_map_first, LOOSE)))
        self._robust.grow(T_map_first[None], edges_of(self._tethers[-1:]))
        self._routes[session] = _Route(chain, [0], {0: node})
        again, self._untied = self._untied, []
        for number in again:
            self._take(problem, number)

    def _place_of(self, problem: Problem, session: int) -> tuple[Array, Chain] | None:
        """``T_map_first`` of a session by most of its closures to sessions in the graph, if `TIES` agree; its chain."""
        known, count = problem.sessions[session], problem.keyframes[session]
        chain = Chain(known.keyframes.poses[0], Steady())
        chain.extend(stacked(known.keyframes.poses[:count]), np.array(known.variances[: count - 1]).reshape(-1, 2))
        ends, places = [], []
        for number in self._untied[-MOST_VOTES:]:
            tie = problem.ties[number]
            there, here, T = tie.end1, tie.end2, tie.constraint.T_from_to
            if there.session == session:
                there, here, T = here, there, inverted(tie.constraint).T_from_to
            if here.session == session and there.session in self._routes:
                self._extend(problem, there.session)
                ends.append(here.keyframe)
                places.append(self._trajectory(there.session).of(np.array([there.keyframe]))[0] @ T)
        if len(ends) < TIES:
            return None
        T_chain_end, T_map_end = chain.T_chain_body[ends], np.array(places)
        T_map_chain = T_map_end @ inverses(T_chain_end)
        apart = np.linalg.norm(
            (T_map_chain[:, None] @ T_chain_end[None])[..., :3, 3] - T_map_end[None, :, :3, 3], axis=2
        )
        ways = np.array([[known.path_m(a, b) for b in ends] for a in ends])
        votes = (np.maximum(apart, apart.T) < AGREEING_M + AGREEING_SHARE * ways).sum(axis=1)
        best = int(votes.argmax())
        return (T_map_chain[best] @ chain.T_chain_body[0], chain) if votes[best] >= TIES else None

    # What is steadily wrong

    def _calibrate(self, problem: Problem) -> None:
        """Take what is steadily wrong out of odometry, or leave it in, whichever explains more."""
        assert self._robust is not None
        expected = problem.params.steady
        if not any(expected):
            return
        plain = self
        if self._is_corrected():
            plain = self._rebuilt(problem, {session: Steady() for session in self._routes})
        assert plain._robust is not None
        suspects = plain._robust.left_out[-MOST_TRIED:] if len(self._numbers) <= FEW else []
        starts = [plain, *map(plain._forced, suspects)]
        best = min((start._corrected(problem) for start in starts), key=lambda solver: solver._cost(expected))
        needed = FREEDOMS_OF_STEADY * len(self._routes) * np.log(FREEDOMS * len(self._numbers))
        chosen = best if best._cost(expected) + needed < plain._cost(expected) else plain
        self._robust, self._routes = chosen._robust, chosen._routes

    def _forced(self, number: int) -> Solver:
        """With a closure that was left out: it may be right where odometry is steadily wrong."""
        assert self._robust is not None
        other = copy(self)
        other._robust = self._robust.forced(number)
        return other

    def _corrected(self, problem: Problem) -> Solver:
        """In turn what the map says is steadily wrong with odometry, and the map, until the first changes little."""
        best, found = self, self._steady(problem)
        for _ in range(ROUNDS):
            best = best._rebuilt(problem, found)
            known, found = found, best._steady(problem)
            if np.allclose([*found.values()], [*known.values()], atol=SETTLED):
                break
        return best

    def _cost(self, expected: Steady) -> float:
        """What all residuals cost, and how unexpected what is steadily wrong is."""
        assert self._robust is not None
        sigmas = np.array(expected)
        steady = np.array([route.chain.steady for route in self._routes.values()])
        return self._robust.cost + float(np.square(steady[:, sigmas > 0] / sigmas[sigmas > 0]).sum())

    def _is_corrected(self) -> bool:
        return any(route.chain.steady != Steady() for route in self._routes.values())

    def _steady(self, problem: Problem) -> dict[int, Steady]:
        """What each session's map says is steadily wrong with its odometry, as far as closures hold it."""
        found = {}
        for session, route in self._routes.items():
            first, last = route.keyframes[0], route.keyframes[-1]
            odom = stacked(problem.sessions[session].keyframes.poses[first : last + 1])
            variances = np.array(problem.sessions[session].variances[first:last]).reshape(-1, 2)
            mapped = self._trajectory(session).of(np.arange(first, last + 1))
            found[session] = estimate(odom, mapped, variances, problem.params.steady)
        return found

    def _rebuilt(self, problem: Problem, steady: dict[int, Steady]) -> Solver:
        """The same nodes and closures, with odometry corrected otherwise."""
        assert self._robust is not None
        other = copy(self)
        other._routes, rows = {}, []
        for session, route in self._routes.items():
            known, count = problem.sessions[session], len(route.chain)
            chain = Chain(known.keyframes.poses[0], steady[session])
            chain.extend(stacked(known.keyframes.poses[:count]), np.array(known.variances[: count - 1]).reshape(-1, 2))
            other._routes[session] = _Route(chain, list(route.keyframes), dict(route.nodes))
            pairs = zip(route.keyframes, route.keyframes[1:], strict=False)
            rows += [(route.nodes[a], route.nodes[b], chain.between(a, b)) for a, b in pairs]
        other._robust = RobustGraph(self._robust.poses[0], self._robust.limit)
        if len(self._robust.poses) > 1:
            other._robust.grow(self._robust.poses[1:], edges_of([*self._tethers, *rows]))
            other._robust.believe(self._robust)
        return other

    # What comes of it

    def _trajectory(self, session: int) -> SolvedTrajectory:
        assert self._robust is not None
        route = self._routes[session]
        nodes = [route.nodes[k] for k in route.keyframes]
        return SolvedTrajectory(copy(route.chain), tuple(route.keyframes), self._robust.poses[nodes])

    def _solution(self, problem: Problem) -> Solution:
        kept, residuals = np.zeros(problem.tie_count, bool), np.full(problem.tie_count, np.inf)
        residuals[self._untied] = np.nan
        if self._robust is not None:
            numbers = list(self._numbers)
            places = list(self._numbers.values())
            kept[numbers] = self._robust.kept[places]
            residuals[numbers] = np.sqrt(self._robust.residuals[places])
        placed = self._placed(problem, kept)
        trajectories = [self._trajectory(s) if s in placed else None for s in range(len(problem.keyframes))]
        return Solution(tuple(trajectories), kept, residuals)

    def _placed(self, problem: Problem, kept: Array) -> set[int]:
        """The sessions that are the first, or tied to it by closures that are believed."""
        pairs = {(problem.ties[k].end1.session, problem.ties[k].end2.session) for k in np.flatnonzero(kept).tolist()}
        placed, grown = set[int](), {0} & self._routes.keys()
        while grown:
            placed |= grown
            grown = {b for pair in pairs for a, b in (pair, pair[::-1]) if a in placed} - placed
        return placed
