# SPDX-License-Identifier: Apache-2.0
"""What the solver is given, and what it gives: keyframes of sessions, closures between them, poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure


class End(NamedTuple):
    """A keyframe of a session, both by number."""

    session: int
    keyframe: int


class Tie(NamedTuple):
    """A constraint between two keyframes; ``closure`` is what it was made of, None for odometry."""

    end1: End
    end2: End
    constraint: Constraint
    closure: LoopClosure | None = None


class Solves(Protocol):
    """The interface of the solver."""

    def solve(self, problem: Problem) -> Solution: ...


class Problem(NamedTuple):
    """What there is to solve at one time, as numbers of what is there by then, since all of it only grows."""

    solver: Solves
    sessions: Sequence[Session]
    keyframes: tuple[int, ...]  # of each session
    ties: Sequence[Tie]  # of closures alone
    tie_count: int
    withdrawn: frozenset[int]  # numbers of ties
    params: MapperParams
    inconsistent: frozenset[int] = frozenset()  # those that others contradict in pairs, for now

    @property
    def left_out(self) -> frozenset[int]:
        """The ties that do not come into the graph."""
        return self.withdrawn | self.inconsistent

    @property
    def limit(self) -> float:
        """The squared residual from which on a closure is left out."""
        return self.params.max_residual**2

    def solve(self) -> Solution:
        """The courses with which all that can be believed agrees best."""
        return self.solver.solve(self)


@dataclass(frozen=True, slots=True)
class SolvedTrajectory:
    """A session in the map: its chain, and ``T_map_body (m, 4, 4)`` of those keyframes that are ``nodes``."""

    chain: Chain
    nodes: tuple[int, ...]
    T_map_body: Array

    def of(self, keyframes: Array | None = None) -> Array:
        """``T_map_body (n, 4, 4)`` of keyframes that the chain has; of all of them if None."""
        return self.chain.spread(self.nodes, self.T_map_body, keyframes)

    def __len__(self) -> int:
        return len(self.chain)


class Solution(NamedTuple):
    """The course of each session, None for one that nothing ties to the first; which ties are ``kept``, and residuals.

    Residuals are in standard deviations: nan of a tie to a session that is not in the map yet, inf of one with which
    there is no solution.
    """

    trajectories: tuple[SolvedTrajectory | None, ...]
    kept: Array
    residuals: Array
