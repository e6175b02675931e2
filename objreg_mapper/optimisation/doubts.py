# SPDX-License-Identifier: Apache-2.0
"""Which closures are left out before a map is solved: what odometry, or most other closures, contradict alone.

Which of the others are believed is found with the map (`robust`).
"""

from __future__ import annotations

from collections.abc import Sequence

from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.pairwise import PairwiseConsistency
from objreg_mapper.optimisation.problem import Tie
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.optimisation.strain import LIMIT, misfits
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session


class Doubts:
    """About the closures of one map, as they come."""

    def __init__(self) -> None:
        self._chains: dict[int, Chain] = {}  # by session
        self._pairwise = PairwiseConsistency()
        self._judged = 0  # ties
        self._contradicted: set[int] = set()

    def of(self, ties: Sequence[Tie], sessions: Sequence[Session], params: MapperParams) -> frozenset[int]:
        """The numbers of ties that are left out as parameters have it."""
        found = frozenset[int]()
        if params.pairwise_consistency:
            found |= self._pairwise.inconsistent(ties, self._chains_of(sessions))
        if params.trust == "odometry":
            found |= self._by_odometry(ties, sessions, params.picture_sigmas)
        return found

    def _by_odometry(
        self, ties: Sequence[Tie], sessions: Sequence[Session], picture_sigmas: tuple[float, float]
    ) -> frozenset[int]:
        """The numbers of ties within a session that odometry alone contradicts, beyond the deviations of both."""
        chains = self._chains_of(sessions)
        for number in range(self._judged, len(ties)):
            tie = ties[number]
            session, other = tie.end1.session, tie.end2.session
            if session == other and misfits([tie], chains[session], picture_sigmas)[2][0] > LIMIT:
                self._contradicted.add(number)
        self._judged = len(ties)
        return frozenset(self._contradicted)

    def _chains_of(self, sessions: Sequence[Session]) -> dict[int, Chain]:
        """Those of all sessions that have keyframes."""
        for number, session in enumerate(sessions):
            if count := len(session.keyframes):
                known = self._chains.get(number) or Chain.of(session, 1, Steady())
                self._chains[number] = known.grown(session, count)
        return self._chains
