# SPDX-License-Identifier: Apache-2.0
"""Which stored keyframes may show the same place as a new one: by what their objects are and how they look.

The index holds one row an object, in one block a label group, so a query touches only objects that could be the same.
Objects vote for their keyframes: the nearer the descriptors and the rarer the label, the more. So do pairs of them that
are as far from each other as those of the new keyframe. Odometry takes out what cannot be there: stored objects of the
same session farther away than its uncertainty has grown. Our own tracking does not: it may have slipped unnoticed. What
is left of the session is likelier than another room, and so are sessions that are known to show the same place: they
share a landmark, or were registered with each other. `benchmarks/rooms.py` measured by how much.
"""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.nearest_neighbours import Block, SessionFilter
from objreg_ros.memory.params import MemoryParams
from objreg_ros.memory.sighting import Sighting
from objreg_ros.native import kernels
from objreg_ros.registration.labels import LabelGroups
from objreg_ros.registration.propose.prior import TIGHT_TRANSLATION_M

_KERNELS = kernels("retrieval")
VOTE_DISTANCE = 0.5  # distance of descriptors at which a vote falls to 0.6
VOTE_CUTOFF = 8.0  # half the squared distance behind the nearest beyond which a vote would be nothing
SHORTLIST = 64  # votes that one object may give
SPARE = 8  # keyframes that a query names for each one that is tried
RANKED = 64  # keyframes with the most votes, which take turns
SAME_PLACE = 8.0  # so much likelier is what the session that goes on saw, or one that is known to show its place
NEXT_OF_PASS = 0.7  # factor on the votes of a place after each one of its pass that is tried before
THIS_PASS = 0.9  # and of the very pass that goes on: its motion is known
NEIGHBOUR = 0.4  # and of a neighbour in time of one that is tried before
EMPTY = Block()


class CandidateKeyframe(NamedTuple):
    """A stored keyframe that may show what a new one shows, with the votes of its objects."""

    keyframe_id: int
    session: int
    stamp_ns: int
    votes: float


class Index:
    """The objects of a store in memory, about 300 bytes each."""

    def __init__(self, params: MemoryParams) -> None:
        self.params = params
        self._groups = LabelGroups(params.label_groups)
        self._blocks: dict[str, Block] = {}  # by label group
        self._numbers: dict[str, int] = {}  # of the blocks, in their order
        self._rows: dict[int, array[int]] = {}  # of each keyframe: the number of a block and a row of it, in turn
        self._met: dict[int, set[int]] = {}  # the sessions that are known to show one place, of each of them
        self._sessions: defaultdict[str, set[int]] = defaultdict(set)  # of each robot

    def __len__(self) -> int:
        return sum(map(len, self._blocks.values()))

    def add_objects(self, sightings: Iterable[Sighting]) -> None:
        """Add the objects of keyframes. Sessions in which the same landmark was seen have met."""
        first_session: dict[int, int] = {}
        for sighting in sightings:
            self._sessions[sighting.robot].add(sighting.session)
            if sighting.landmark:  # 0: it has none yet
                self.meet(sighting.session, first_session.setdefault(sighting.landmark, sighting.session))
            group = self._groups.of(sighting.label)
            if group not in self._blocks:
                self._blocks[group], self._numbers[group] = Block(), len(self._numbers)
            row = self._blocks[group].append(sighting)
            self._rows.setdefault(sighting.keyframe_id, array("q")).extend((self._numbers[group], row))

    def sessions_of(self, robot: str) -> frozenset[int]:
        """Those of which a robot's objects were added."""
        return frozenset(self._sessions.get(robot, ()))

    def remove(self, keyframe_ids: Iterable[int]) -> None:
        """Forget every object of these keyframes."""
        blocks = list(self._blocks.values())
        for number in keyframe_ids:
            pairs = self._rows.pop(number, array("q"))
            for block, row in zip(pairs[::2], pairs[1::2], strict=True):
                blocks[block].remove(row)

    def meet(self, session: int, other: int) -> None:
        """Two sessions show the same place: so do all that either was known to share one with."""
        if other not in self._met.get(session, {session}):
            together = self._met.get(session, {session}) | self._met.get(other, {other})
            self._met |= dict.fromkeys(together, together)

    def query(self, sightings: Sequence[Sighting], hidden: Collection[int] = ()) -> list[CandidateKeyframe]:
        """Places of all sessions but those ``hidden`` for the objects of a new keyframe, the most promising first.

        May be empty. There are more than ``candidates``, so that those which turn out to be redundant have successors.
        """
        sessions = SessionFilter.of(self._sessions.get(sightings[0].robot, ()), hidden)
        ballots = [self._ballot(sighting, len(self), sessions) for sighting in sightings]
        where, when, votes = (np.concatenate(column) for column in zip(*ballots, strict=True))
        ballot = np.repeat(np.arange(len(ballots)), [len(ballot[-1]) for ballot in ballots])
        positions = np.array([sighting.position for sighting in sightings], float)
        first, votes = _KERNELS.tally(when[:, 2], ballot, votes.astype(float), where[:, :3], positions)
        where, when = where[first], when[first]
        votes = votes * self._likelihood(when[:, 1], where[:, 3], sightings[0])
        ranked = np.argsort(-votes, kind="stable")[:RANKED]  # the older first among equals
        taken = ranked[self._turns(where[ranked], when[ranked], votes[ranked])[: SPARE * self.params.candidates]]
        chosen = zip(when[taken].tolist(), votes[taken].tolist(), strict=True)
        return [CandidateKeyframe(number, session, stamp_ns, vote) for (stamp_ns, session, number, _), vote in chosen]

    def _ballot(self, sighting: Sighting, stored: int, sessions: SessionFilter) -> tuple[Array, Array, Array]:
        """Where and when the objects were seen that look most like this one, the nearest first, and their votes."""
        block = self._blocks.get(self._groups.of(sighting.label), EMPTY)
        rows, halves = block.nearest(sighting, self.params, SHORTLIST, VOTE_CUTOFF, sessions)
        rarity = math.log(2.0 + stored / max(len(block), 1))
        return block.where[rows], block.when[rows], rarity * np.exp(-halves / VOTE_DISTANCE**2)

    def _likelihood(self, session: Array, travelled: Array, asked: Sighting) -> Array:
        """How much likelier than in a session that may be anywhere a place is before anything is seen of it, (K,)."""
        here = self._same_pass(session, travelled, asked.session, asked.travelled)
        together = np.isin(session, list(self._met.get(asked.session, (asked.session,))))
        return np.where(together, SAME_PLACE, 1.0) * np.where(here, THIS_PASS, 1.0)

    def _turns(self, where: Array, when: Array, votes: Array) -> Array:
        """The order in which to try: the best of each pass by here before what is not much less likely of the same.

        Neighbours of a chosen keyframe come after other places that are not much less likely.
        """
        stamp_ns, session, travelled = when[:, 0], when[:, 1], where[:, 3]
        near = (session[:, None] == session) & (
            np.abs(stamp_ns[:, None] - stamp_ns) < round(1e9 * self.params.thin_seconds)
        )
        same = self._same_pass(session[:, None], travelled[:, None], session, travelled)
        factors = np.where(near, NEIGHBOUR, 1.0) * np.where(same, NEXT_OF_PASS, 1.0)
        return np.asarray(_KERNELS.in_turn(votes, factors))

    def _same_pass(
        self, session: Array, travelled: Array, other_session: Array | int, other_travelled: Array | float
    ) -> Array:
        """Whether odometry is certain of the motion between the two."""
        params, path = self.params, np.abs(travelled - other_travelled)
        sigma = params.odometry_translation_noise + params.odometry_drift * path
        return np.asarray((session == other_session) & (sigma <= TIGHT_TRANSLATION_M))
