# SPDX-License-Identifier: Apache-2.0
"""Whether odometry is steadily wrong, by which of two maps explains more: the one with that taken out, or without.

What is steadily wrong is taken out where that explains as much more as three more numbers must (Schwarz, "Estimating
the dimension of a model", 1978): a few closures that err a little in one direction are no evidence of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from objreg_mapper.optimisation.edges import edges_of
from objreg_mapper.optimisation.problem import Problem
from objreg_mapper.optimisation.robust import Belief, RobustGraph
from objreg_mapper.optimisation.route import Route, Row
from objreg_mapper.optimisation.steady import Steady, estimate
from objreg_mapper.session import stacked
from objreg_ros.data.checked import Array

FREEDOMS, FREEDOMS_OF_STEADY = 6, 3  # of a closure, and of what is steadily wrong with an odometry
FEW, MOST_TRIED = 30, 2  # closures with which one that was left out may be right; of those, the newest
ROUNDS = 4  # most times that odometry is corrected
SETTLED = 5e-4  # rad/m and m/m: a change of its steady error that matters no more

Routes = Mapping[int, Route]  # by session


class Fit(NamedTuple):
    """Routes with odometry corrected in one way, and the graph that is solved with them."""

    routes: Routes
    graph: RobustGraph

    @property
    def is_corrected(self) -> bool:
        """Whether anything was taken out of an odometry."""
        return any(route.chain.steady != Steady() for route in self.routes.values())

    def cost(self, expected: Steady) -> float:
        """What all residuals cost, and how unexpected what is steadily wrong is."""
        sigmas = np.array(expected)
        steady = np.array([route.chain.steady for route in self.routes.values()])
        return self.graph.cost + float(np.square(steady[:, sigmas > 0] / sigmas[sigmas > 0]).sum())


@dataclass(frozen=True, slots=True)
class OdometryCalibration:
    """Of the sessions of a problem; ``tethers`` tie nodes in its graph beside odometry and closures."""

    problem: Problem
    tethers: Sequence[Row]

    def plain(self, now: Fit) -> Fit:
        """The fit with odometry as it is; that which is given where nothing was taken out, or nothing can be."""
        if not (now.is_corrected and any(self.problem.params.steady)):
            return now
        return self._fit(now.routes, dict.fromkeys(now.routes, Steady()), now.graph.belief())

    def best(self, plain: Fit) -> Fit:
        """The fit that explains most, the `plain` one if none explains more."""
        expected, count = self.problem.params.steady, len(plain.graph.closures)
        if not any(expected):
            return plain
        suspects = plain.graph.left_out[-MOST_TRIED:] if count <= FEW else []
        starts = [plain.graph.belief(), *map(plain.graph.belief_with, suspects)]  # it may be right if odometry is not
        best = min((self._corrected(plain.routes, start) for start in starts), key=lambda fit: fit.cost(expected))
        needed = FREEDOMS_OF_STEADY * len(plain.routes) * np.log(FREEDOMS * count)
        return best if best.cost(expected) + needed < plain.cost(expected) else plain

    def _corrected(self, routes: Routes, belief: Belief) -> Fit:
        """In turn what the map says is steadily wrong with odometry, and the map, until the first changes little."""
        found = self._steady(routes, belief.poses)
        fit = self._fit(routes, found, belief)
        for _ in range(ROUNDS - 1):
            routes, belief = fit.routes, fit.graph.belief()
            known, found = found, self._steady(routes, belief.poses)
            if np.allclose([*found.values()], [*known.values()], atol=SETTLED):
                break
            del fit  # it takes no memory while the next is made
            fit = self._fit(routes, found, belief)
        return fit

    def _steady(self, routes: Routes, poses: Array) -> dict[int, Steady]:
        """What each session's map says is steadily wrong with its odometry, as far as closures hold it."""
        return {session: self._steady_of(session, route, poses) for session, route in routes.items()}

    def _steady_of(self, session: int, route: Route, poses: Array) -> Steady:
        known, first, last = self.problem.sessions[session], route.keyframes[0], route.keyframes[-1]
        odom = stacked(known.keyframes.poses[first : last + 1])
        variances = np.array(known.variances[first:last]).reshape(-1, 2)
        mapped = route.solved(poses).of(np.arange(first, last + 1))
        return estimate(odom, mapped, variances, self.problem.params.steady)

    def _fit(self, routes: Routes, steady: Mapping[int, Steady], belief: Belief) -> Fit:
        """The same nodes and closures, with odometry corrected otherwise."""
        sessions = self.problem.sessions
        corrected = {k: route.corrected(sessions[k], steady[k]) for k, route in routes.items()}
        steps = edges_of([*self.tethers, *(row for route in corrected.values() for row in route.steps())])
        return Fit(corrected, RobustGraph.believing(belief, steps, self.problem.limit))
