# SPDX-License-Identifier: Apache-2.0
"""Which stored keyframes may show the same place as a new one: by what their objects are and how they look.

The index holds one row an object, in one block a label group, so a query touches only objects that could be the same.
Objects vote for their keyframes: the nearer the descriptors and the rarer the label, the more. Odometry takes out what
cannot be there: stored objects of the same session farther away than its uncertainty has grown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.registrar.descriptor import SIZE
from objreg_ros.registrar.labels import LabelGroups
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.sighting import Sighting

LIKENESS = 0.5  # distance of descriptors at which a vote falls to 0.6
WORTH_A_VOTE = 8.0  # half the squared distance behind the likest beyond which a vote would be nothing
SHORTLIST = 64  # votes that one object may give
SPARE = 4  # keyframes that a query names for each one that is tried


class Place(NamedTuple):
    """A stored keyframe that may show what a new one shows, with the votes of its objects."""

    keyframe_id: int
    stamp_ns: int
    travelled: float
    turned: float
    session: int
    votes: float


@dataclass(slots=True, eq=False)
class _Block:
    """The rows of one label group in columns that grow by doubling."""

    size: int = 0
    descriptor: Array = field(default_factory=lambda: np.zeros((64, SIZE), np.float32))
    half_norm: Array = field(default_factory=lambda: np.zeros(64, np.float32))
    position: Array = field(default_factory=lambda: np.zeros((64, 3), np.float32))
    travelled: Array = field(default_factory=lambda: np.zeros(64))
    turned: Array = field(default_factory=lambda: np.zeros(64))
    stamp_ns: Array = field(default_factory=lambda: np.zeros(64, np.int64))
    session: Array = field(default_factory=lambda: np.zeros(64, np.int32))
    keyframe_id: Array = field(default_factory=lambda: np.zeros(64, np.int64))

    COLUMNS = ("descriptor", "half_norm", "position", "travelled", "turned", "stamp_ns", "session", "keyframe_id")

    def append(self, row: Sighting) -> None:
        if self.size == len(self.keyframe_id):
            for name in self.COLUMNS:
                column = getattr(self, name)
                setattr(self, name, np.concatenate([column, np.zeros_like(column)]))
        i, self.size = self.size, self.size + 1
        self.descriptor[i], self.half_norm[i] = row.descriptor, 0.5 * float(row.descriptor @ row.descriptor)
        self.position[i], self.travelled[i], self.stamp_ns[i] = row.position, row.travelled, row.stamp_ns
        self.turned[i], self.session[i], self.keyframe_id[i] = row.turned, row.session, row.keyframe_id

    def remove(self, keyframe_ids: Iterable[int]) -> None:
        kept = np.flatnonzero(~np.isin(self.keyframe_id[: self.size], list(keyframe_ids)))
        for name in self.COLUMNS:
            column = getattr(self, name)
            column[: len(kept)] = column[kept]
        self.size = len(kept)


class Index:
    """The objects of a store in memory, about 140 bytes each."""

    def __init__(self, params: RegistrarParams) -> None:
        self._params = params
        self._groups = LabelGroups(params.label_groups)
        self._blocks: dict[str, _Block] = {}

    def __len__(self) -> int:
        return sum(block.size for block in self._blocks.values())

    def add(self, sightings: Iterable[Sighting]) -> None:
        """Add the objects of a keyframe."""
        for sighting in sightings:
            self._blocks.setdefault(self._groups.of(sighting.label), _Block()).append(sighting)

    def remove(self, keyframe_ids: Sequence[int]) -> None:
        """Forget every object of these keyframes."""
        for block in self._blocks.values():
            block.remove(keyframe_ids)

    def query(self, sightings: Sequence[Sighting]) -> list[Place]:
        """Places for the objects of a new keyframe, the most promising first; may be empty.

        There are more than ``candidates``, so that those which turn out to be redundant have successors.
        """
        found: dict[int, Place] = {}
        for sighting in sightings:
            for place in self._votes(sighting):
                known = found.get(place.keyframe_id)
                found[place.keyframe_id] = place._replace(votes=place.votes + (known.votes if known else 0.0))
        places = sorted(found.values(), key=lambda place: (-place.votes, place.keyframe_id))
        here = [place for place in places if self._same_pass(place, sightings[0])]
        before = [place for place in places if not self._same_pass(place, sightings[0])]
        most = SPARE * self._params.candidates
        return self._spread(before[:most], here[:most])

    def _votes(self, row: Sighting) -> list[Place]:
        """At most one vote a keyframe: its likest object's."""
        block = self._blocks.get(self._groups.of(row.label))
        if block is None or block.size == 0:
            return []
        n = block.size
        likeness = self._likeness(block, row)
        best = np.flatnonzero(likeness > max(likeness.max() - WORTH_A_VOTE, -1e30))
        if len(best) > SHORTLIST:
            best = best[np.argpartition(-likeness[best], SHORTLIST)[:SHORTLIST]]
        best = best[np.lexsort((block.keyframe_id[best], -likeness[best]))]
        squared = np.maximum(float(row.descriptor @ row.descriptor) - 2.0 * likeness[best].astype(float), 0.0)
        vote = np.exp(-0.5 * squared / LIKENESS**2) * np.log(2.0 + len(self) / n)
        ids, first = np.unique(block.keyframe_id[best], return_index=True)
        rows = best[first]
        where = (column[rows] for column in (block.stamp_ns, block.travelled, block.turned, block.session))
        columns = [column.tolist() for column in (ids, *where, vote[first])]
        return [Place(*values) for values in zip(*columns, strict=True)]

    def _likeness(self, block: _Block, row: Sighting) -> Array:
        """How alike each object of the block is, up to a constant; -inf if it is too near in time or too far away."""
        n, params = block.size, self._params
        columns = (getattr(block, name)[:n] for name in ("position", "travelled", "stamp_ns", "session"))
        return np.asarray(
            _likeness(  # type: ignore[call-arg]
                block.descriptor[:n], block.half_norm[:n], *columns,
                row.descriptor, row.position.astype(np.float32), row.travelled, row.stamp_ns, row.session,
                round(1e9 * params.min_gap), params.odometry_radius, params.odometry_drift,
            )
        )  # fmt: skip

    def _spread(self, before: list[Place], here: list[Place]) -> list[Place]:
        """The best of each pass by here, then the next best of each, ``here``, this very pass, last among equals.

        Neighbours of a chosen keyframe come after every other place.
        """
        spacing = round(1e9 * self._params.thin_seconds)
        chosen: list[Place] = []
        rank: dict[int, tuple[bool, int]] = {}
        for place in before + here:
            near = any(abs(place.stamp_ns - other.stamp_ns) < spacing for other in chosen)
            rank[place.keyframe_id] = near, 0 if near else sum(self._same_pass(place, other) for other in chosen)
            if not near:
                chosen.append(place)
        return sorted(before + here, key=lambda place: rank[place.keyframe_id])

    def _same_pass(self, place: Place, other: Place | Sighting) -> bool:
        """Whether odometry is certain of the motion between the two."""
        params, way = self._params, abs(place.travelled - other.travelled)
        sigma = params.odometry_translation_noise + params.odometry_drift * way
        return place.session == other.session and sigma <= params.prior_translation


@numba.njit(cache=True, nogil=True)
def _likeness(  # type: ignore[no-untyped-def]
    descriptors, half_norms, positions, travelled, stamps_ns, sessions,
    descriptor, position, way, stamp_ns, session, gap_ns, radius, drift,
):  # fmt: skip
    """In one pass over the rows, because at 1e5 objects the memory is what costs: (n,) float32."""
    out = np.full(len(descriptors), -np.inf, np.float32)
    for i in range(len(descriptors)):
        if abs(stamps_ns[i] - stamp_ns) < gap_ns:
            continue
        if sessions[i] == session:
            reach = radius + drift * abs(way - travelled[i])
            x, y, z = positions[i, 0] - position[0], positions[i, 1] - position[1], positions[i, 2] - position[2]
            if x * x + y * y + z * z > reach * reach:
                continue
        out[i] = _dot(descriptors[i], descriptor) - half_norms[i]
    return out


@numba.njit(cache=True, nogil=True, fastmath=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = np.float32(0.0)
    for k in range(len(a)):
        total += a[k] * b[k]
    return total
