# SPDX-License-Identifier: Apache-2.0
"""Which objects of a store were moved and when, by the evidence of its closures.

A closure reports how far an object moved: one of its views shows the object at a place that is free space in the other
view, and the other view shows it elsewhere. So it was moved between the two. The reports on one object are combined: as
few moves as explain all of them, each within the time that all of its closures leave.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, transform
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registration.keyframe import Keyframe

EVIDENCE = re.compile(r"moved (?P<label>.+) \[m\]")
SAME_M = 1e-3  # between the distance in the evidence and that of its two objects


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MoveNote:
    """The report of closure number ``closure`` on one object: it moved by ``metres`` from ``there`` to ``here``.

    ``stood (3,)`` is its earlier position in m, in the session of ``here``.
    """

    closure: int
    there: Sighting
    here: Sighting
    stood: Array
    metres: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Move:
    """One move of an object, after ``there`` was seen and before ``here`` was; ``closures`` is how many report it.

    ``nearest`` is the report whose two keyframes are closest in time.
    """

    there: Sighting
    here: Sighting
    nearest: MoveNote
    closures: int


@dataclass(frozen=True, slots=True)
class Moves:
    """The ``known`` moves, the oldest first; ``untold`` counts reports on keyframes that are no longer stored."""

    known: tuple[Move, ...] = ()
    untold: int = 0


def moves_in(store: Store, sightings: Sequence[Sighting]) -> Moves:
    """The moves of objects that the closures of a store report; StoreError where they cannot be read."""
    ids: defaultdict[int, set[int]] = defaultdict(set)
    for sighting in sightings:
        ids[sighting.stamp_ns].add(sighting.keyframe_id)
    reports: list[MoveNote] = []
    untold = 0
    for number, closure in enumerate(store.closures()):
        for label, metres in _distances(closure):
            found = list(_moves_of(store, ids, number, closure, label, metres))
            reports += found
            untold += not found
    moves = [move for of_one in _by_object(reports) for move in _fewest(of_one)]
    return Moves(tuple(sorted(moves, key=lambda move: (move.here.keyframe_id, move.here.landmark))), untold)


def _distances(closure: LoopClosure) -> Iterator[tuple[str, float]]:
    for name, metres in closure.evidence.items():
        if named := EVIDENCE.fullmatch(name):
            yield named["label"], metres


def _moves_of(
    store: Store, ids: dict[int, set[int]], number: int, closure: LoopClosure, label: str, metres: float
) -> Iterator[MoveNote]:
    """The reports on the keyframes of both stamps. Two runs of one recording share their stamps: it holds for both."""
    for from_id in sorted(ids.get(closure.from_ns, ())):
        for to_id in sorted(ids.get(closure.to_ns, ())):
            if from_id < to_id:
                yield from _between(store, (from_id, to_id), number, closure.T_from_to, label, metres)


def _between(
    store: Store, ids: tuple[int, int], number: int, T_from_to: Array, label: str, metres: float
) -> Iterator[MoveNote]:
    try:
        before, after = (store.keyframe(keyframe_id) for keyframe_id in ids)
    except StoreError:
        return  # a damaged keyframe gives no report
    there, here = (list(store.sightings(keyframe_id)) for keyframe_id in ids)
    gone, new = transform(inverse(T_from_to), _middles(before)), _middles(after)
    distances = np.linalg.norm(gone[:, None] - new[None], axis=-1)
    T_session_to = np.eye(4) if after.T_odom_camera is None else after.T_odom_camera
    for i, j in np.argwhere(np.abs(distances - metres) < SAME_M).tolist():
        if here[j].label == label:
            stood = transform(T_session_to, gone[i])
            yield MoveNote(closure=number, there=there[i], here=here[j], stood=stood, metres=metres)


def _middles(keyframe: Keyframe) -> Array:
    return np.array([item.centroid for item in keyframe.objects]).reshape(-1, 3)


def _by_object(reports: Sequence[MoveNote]) -> list[list[MoveNote]]:
    """The reports on each object: landmarks are of one object where a report joins them."""
    groups: list[tuple[set[int], list[MoveNote]]] = []
    for note in reports:
        landmarks, of_one = {note.there.landmark, note.here.landmark}, [note]
        for group in [group for group in groups if group[0] & landmarks]:
            groups.remove(group)
            landmarks, of_one = landmarks | group[0], group[1] + of_one
        groups.append((landmarks, of_one))
    return [of_one for _, of_one in groups]


def _fewest(reports: Sequence[MoveNote]) -> Iterator[Move]:
    """As few moves as explain all reports: each lies in every span that begins before its first one ends."""
    left = sorted(reports, key=lambda note: note.here.keyframe_id)
    while left:
        end = left[0].here.keyframe_id
        together = [note for note in left if note.there.keyframe_id < end]
        left = [note for note in left if note.there.keyframe_id >= end]
        yield Move(
            there=max((note.there for note in together), key=lambda s: s.keyframe_id),
            here=together[0].here,
            nearest=min(together, key=lambda t: t.here.keyframe_id - t.there.keyframe_id),
            closures=len({note.closure for note in together}),
        )
