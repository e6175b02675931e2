# SPDX-License-Identifier: Apache-2.0
"""Which stored keyframes may show the same place as a new one: by what their objects are and how they look.

The index holds one row an object, in one block a label group, so a query touches only objects that could be the same.
Objects vote for their keyframes: the nearer the descriptors and the rarer the label, the more. Odometry takes out what
cannot be there: stored objects of the same session farther away than its uncertainty has grown. Our own tracking does
not: it may have slipped unnoticed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.memory.nearest_neighbours import Block
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.labels import LabelGroups
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.propose.prior import TIGHT_TRANSLATION_M

VOTE_DISTANCE = 0.5  # distance of descriptors at which a vote falls to 0.6
VOTE_CUTOFF = 8.0  # half the squared distance behind the nearest beyond which a vote would be nothing
SHORTLIST = 64  # votes that one object may give
SPARE = 4  # keyframes that a query names for each one that is tried
EMPTY = Block()


class CandidateKeyframe(NamedTuple):
    """A stored keyframe that may show what a new one shows, with the votes of its objects."""

    keyframe_id: int
    stamp_ns: int
    votes: float


class Index:
    """The objects of a store in memory, about 200 bytes each."""

    def __init__(self, params: RegistrarParams) -> None:
        self._params = params
        self._groups = LabelGroups(params.label_groups)
        self._blocks: dict[str, Block] = {}
        self._rows: dict[int, list[tuple[Block, int]]] = {}  # of each keyframe

    def __len__(self) -> int:
        return sum(map(len, self._blocks.values()))

    def add(self, sightings: Iterable[Sighting]) -> None:
        """Add the objects of a keyframe."""
        for sighting in sightings:
            block = self._blocks.setdefault(self._groups.of(sighting.label), Block())
            self._rows.setdefault(sighting.keyframe_id, []).append((block, block.append(sighting)))

    def remove(self, keyframe_ids: Iterable[int]) -> None:
        """Forget every object of these keyframes."""
        for block, row in chain.from_iterable(self._rows.pop(number, ()) for number in keyframe_ids):
            block.remove(row)

    def query(self, sightings: Sequence[Sighting], since: int = 0) -> list[CandidateKeyframe]:
        """Places of the sessions from ``since`` on for the objects of a new keyframe, the most promising first.

        May be empty. There are more than ``candidates``, so that those which turn out to be redundant have successors.
        """
        ballots = [self._ballot(sighting, len(self), since) for sighting in sightings]
        where, when, votes = (np.concatenate(column) for column in zip(*ballots, strict=True))
        ballot = np.repeat(np.arange(len(ballots)), [len(ballot[-1]) for ballot in ballots])
        first, votes = _tally(when[:, 2], ballot, votes)
        where, when = where[first], when[first]
        here = self._same_pass(when[:, 1], where[:, 3], sightings[0].session, sightings[0].travelled)
        order = np.argsort(-votes, kind="stable")  # the older first among equals
        most, here = SPARE * self._params.candidates, here[order]
        taken = order[np.concatenate([np.flatnonzero(~here)[:most], np.flatnonzero(here)[:most]])]
        taken = taken[self._spread(where[taken], when[taken])]
        chosen = zip(when[taken].tolist(), votes[taken].tolist(), strict=True)
        return [CandidateKeyframe(number, stamp_ns, vote) for (stamp_ns, _, number, _), vote in chosen]

    def _ballot(self, sighting: Sighting, stored: int, since: int) -> tuple[Array, Array, Array]:
        """Where and when the objects were seen that look most like this one, the nearest first, and their votes."""
        block = self._blocks.get(self._groups.of(sighting.label), EMPTY)
        rows, halves = block.nearest(sighting, self._params, SHORTLIST, VOTE_CUTOFF, since)
        rarity = math.log(2.0 + stored / max(len(block), 1))
        return block.where[rows], block.when[rows], rarity * np.exp(-halves / VOTE_DISTANCE**2)

    def _spread(self, where: Array, when: Array) -> Array:
        """The order in which to try: the best of each pass by here, then the next best of each, this very pass last.

        Neighbours of a chosen keyframe come after every other place.
        """
        stamp_ns, session, travelled = when[:, 0], when[:, 1], where[:, 3]
        near = np.abs(stamp_ns[:, None] - stamp_ns) < round(1e9 * self._params.thin_seconds)
        same = self._same_pass(session[:, None], travelled[:, None], session, travelled)
        return np.argsort(_turns(near, same), kind="stable")

    def _same_pass(
        self, session: Array, travelled: Array, other_session: Array | int, other_travelled: Array | float
    ) -> Array:
        """Whether odometry is certain of the motion between the two."""
        params, way = self._params, np.abs(travelled - other_travelled)
        sigma = params.odometry_translation_noise + params.odometry_drift * way
        return np.asarray((session == other_session) & (sigma <= TIGHT_TRANSLATION_M))


@numba.njit(cache=True, nogil=True)
def _tally(keyframe_ids, ballots, votes):  # type: ignore[no-untyped-def]
    """A row of each keyframe, the oldest first, and its votes: of each ballot the first, its nearest object's."""
    order = np.argsort(keyframe_ids, kind="mergesort")
    first, total, found = np.empty(len(order), np.int64), np.zeros(len(order)), 0
    for k, row in enumerate(order):
        before = order[k - 1]
        new = k == 0 or keyframe_ids[row] != keyframe_ids[before]
        if new:
            first[found] = row
            found += 1
        if new or ballots[row] != ballots[before]:
            total[found - 1] += votes[row]
    return first[:found], total[:found]


@numba.njit(cache=True, nogil=True)
def _turns(near, same):  # type: ignore[no-untyped-def]
    """In which turn each place comes: so many of its pass were chosen before it; after all turns what is near one."""
    chosen, turns = np.zeros(len(near), np.bool_), np.zeros(len(near), np.int64)
    for i in range(len(near)):
        chosen[i] = not (near[i] & chosen).any()
        turns[i] = (same[i, :i] & chosen[:i]).sum() if chosen[i] else len(near)
    return turns
