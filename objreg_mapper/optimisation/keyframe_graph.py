# SPDX-License-Identifier: Apache-2.0
"""The graph of a map: a node where a closure holds a keyframe, and in between what `Chain` says."""

from __future__ import annotations

import numpy as np

from objreg_mapper.constraint import Constraint, freed
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.edges import edges_of
from objreg_mapper.optimisation.odometry_calibration import Fit, OdometryCalibration
from objreg_mapper.optimisation.problem import End, Problem, SolvedTrajectory, Tie
from objreg_mapper.optimisation.robust import RobustGraph
from objreg_mapper.optimisation.route import Route, Row
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse

LOOSE = np.diag(np.repeat([1e4, 10.0], 3) ** 2)  # m and rad: what ties a session that only closures hold


class KeyframeGraph:
    """Sessions, by number, of which the first begins with a keyframe that is held where its odometry has it.

    ``robust`` has the nodes and closures; its numbers of these are those that `close` returns.
    """

    def __init__(self, first: Session, limit: float) -> None:
        T_map_first = first.keyframes.poses[0]
        self.robust = RobustGraph(T_map_first, limit)
        self._routes = {0: Route.begun(Chain.begun(T_map_first, Steady()), 0)}
        self._tethers: list[Row] = []  # what holds pictures to keyframes, and sessions, loosely
        self._held: set[int] = set()  # nodes of keyframes that a closure holds
        self._pictures: dict[int, int] = {}  # nodes by those of their keyframes

    def has(self, session: int) -> bool:
        """Whether a session is in it."""
        return session in self._routes

    def close(self, problem: Problem, tie: Tie) -> int:
        """Take in a closure between sessions that are in it. Returns its number."""
        nodes = [self._node(problem, end) for end in (tie.end1, tie.end2)]
        sigmas = problem.params.picture_sigmas
        first, second = (node not in self._held or not all(sigmas) for node in nodes)  # it has that error for itself
        k1, k2 = (self._picture(node, sigmas) for node in nodes)
        said, free = freed(tie.constraint, sigmas, (first, second)), freed(tie.constraint, sigmas)
        self.robust.close(edges_of([(k1, k2, said)]), edges_of([(k1, k2, free)]))
        self._held.update(nodes)
        return len(self.robust.closures) - 1

    def _node(self, problem: Problem, end: End) -> int:
        """The node of a keyframe, which becomes one if it is none; so do some on the path there from the last."""
        self._grow(problem, end.session)
        for keyframe in self._routes[end.session].missing(end.keyframe):
            self._insert(end.session, keyframe)
        return self._routes[end.session].node_of(end.keyframe)

    def _grow(self, problem: Problem, session: int) -> None:
        """Bring a route to the keyframes that the problem has."""
        route, count = self._routes[session], problem.keyframes[session]
        self._routes[session] = route.grown(problem.sessions[session], count)

    def _insert(self, session: int, keyframe: int) -> None:
        node, route = len(self.robust.poses), self._routes[session]
        new = route.insertion(keyframe, node, self.robust.poses)
        self.robust.grow(new.T_map_body, edges_of(new.steps), new.instead_of)
        self._routes[session] = route.with_node(keyframe, node)

    def _picture(self, node: int, sigmas: tuple[float, float]) -> int:
        """The node of what a keyframe saw: the keyframe's, but for an error that closures of it share.

        The first closure has that error for itself, as most are the only one of their keyframe.
        """
        if node not in self._held or not all(sigmas):
            return node
        if node not in self._pictures:
            same = Constraint(np.eye(4), np.diag(np.repeat(np.square(sigmas), 3)))
            self._pictures[node] = self._tether(node, self.robust.poses[node], same)
        return self._pictures[node]

    def _tether(self, node: int, T_map_new: Array, constraint: Constraint) -> int:
        """Add a node that a constraint ties to another. Returns its number."""
        new = len(self.robust.poses)
        self._tethers.append((node, new, constraint))
        self.robust.grow(T_map_new[None], edges_of(self._tethers[-1:]))
        return new

    def join(self, session: int, T_map_first: Array, chain: Chain) -> None:
        """Take in a session that begins at a place."""
        T_0_first = inverse(self.robust.poses[0]) @ T_map_first
        node = self._tether(0, T_map_first, Constraint(T_0_first, LOOSE))
        self._routes[session] = Route.begun(chain, node)

    def calibrate(self, problem: Problem) -> None:
        """Take what is steadily wrong out of odometry, or leave it in, whichever explains more."""
        calibration = OdometryCalibration(problem, self._tethers)
        for step in (calibration.plain, calibration.best):  # after the first, the graph of before takes no memory
            fit = step(Fit(self._routes, self.robust))
            self._routes, self.robust = dict(fit.routes), fit.graph
            del fit

    def place_of(self, problem: Problem, end: End) -> Array | None:
        """``T_map_body`` of a keyframe; None of one whose session is not in it."""
        if not self.has(end.session):
            return None
        self._grow(problem, end.session)
        return self.trajectory(end.session).of(np.array([end.keyframe]))[0]

    def trajectory(self, session: int) -> SolvedTrajectory:
        """The course of a session that is in it."""
        return self._routes[session].solved(self.robust.poses)
