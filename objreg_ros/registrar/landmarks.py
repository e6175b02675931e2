# SPDX-License-Identifier: Apache-2.0
"""Objects of the place with ids that stay: the same cup has the same id in every keyframe and session.

Two sightings are the same landmark where they are at the same place in the same session, or where a closure put them
upon each other. When a closure shows that two landmarks are one, the older id stays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data import Array
from objreg_ros.registrar.labels import LabelGroups
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.sighting import Sighting

MIDDLE_WANDERS = 0.2  # of the extent


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Landmark:
    """A known object: ``position (3,)`` m in the frame of the ``session`` that saw it last, at ``stamp_ns``."""

    landmark: int
    label: str
    position: Array
    session: int
    stamp_ns: int
    sightings: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Link:
    """A closure's word that object ``index`` of the new keyframe is the stored sighting ``of``.

    ``R_there_here (3, 3)`` turns the axes of the new keyframe's session into those of the stored one's.
    """

    index: int
    of: Sighting
    R_there_here: Array


@dataclass(slots=True, eq=False)
class _Known:
    """What is kept of one landmark: its latest sighting, votes for its label, and from where each keyframe saw it."""

    last: Sighting
    votes: Counter[str] = field(default_factory=Counter)
    views: dict[int, Array] = field(default_factory=dict)


class Landmarks:
    """All known objects. Deterministic: the same sightings in the same order give the same ids."""

    def __init__(self, params: RegistrarParams, sightings: Iterable[Sighting] = ()) -> None:
        self._params = params
        self._groups = LabelGroups(params.label_groups)
        self._known: dict[int, _Known] = {}
        self._next = 1
        self.add(sightings)

    def __len__(self) -> int:
        return len(self._known)

    def known(self) -> tuple[Landmark, ...]:
        """Every landmark, the oldest first."""
        return tuple(_landmark(number, known) for number, known in sorted(self._known.items()))

    def assign(
        self, sightings: Sequence[Sighting], links: Sequence[Link] = ()
    ) -> tuple[tuple[Sighting, ...], dict[int, int]]:
        """The sightings of a new keyframe with their landmarks, and which landmarks turned out to be which older."""
        merged: dict[int, int] = {}
        named: list[Sighting] = []
        taken: set[int] = set()
        for index, sighting in enumerate(sightings):
            claims = [link for link in links if link.index == index]
            here = self._same_place(sighting, taken)
            numbers = {_root(merged, link.of.landmark) for link in claims} | ({here} if here else set())
            if not numbers:
                named.append(sighting.of_landmark(self._next, np.eye(3)))
                self._next += 1
                continue
            oldest = min(numbers)
            merged.update({number: oldest for number in numbers if number != oldest})
            taken.add(oldest)
            named.append(sighting.of_landmark(oldest, self._axes(sighting, claims, here)))
        return tuple(named), merged

    def add(self, sightings: Iterable[Sighting], merged: dict[int, int] | None = None) -> None:
        """Take in sightings that have their landmarks, after merging the landmarks that turned out to be one."""
        for old, new in (merged or {}).items():
            self._merge(old, new)
        for sighting in sightings:
            known = self._known.setdefault(sighting.landmark, _Known(sighting))
            known.last = sighting
            known.votes[sighting.label] += round(1000 * sighting.score)
            known.views[sighting.keyframe_id] = sighting.viewpoint
            self._next = max(self._next, sighting.landmark + 1)

    def surplus(self, landmarks: Iterable[int]) -> list[int]:
        """Keyframes of these landmarks that show each of their objects from where better spread keyframes do too."""
        spare = {number: self._spare(self._known[number]) for number in set(landmarks) if number in self._known}
        tired = set().union(*spare.values()) if spare else set()
        needed = {k for number, known in self._known.items() for k in known.views if k not in spare.get(number, ())}
        return sorted(tired - needed)

    def forget(self, keyframe_ids: Iterable[int]) -> None:
        """Forget from where these keyframes saw their objects; the landmarks stay known."""
        gone = set(keyframe_ids)
        for known in self._known.values():
            for keyframe_id in gone & known.views.keys():
                del known.views[keyframe_id]

    def _same_place(self, sighting: Sighting, taken: set[int]) -> int:
        """The landmark that this session saw last at this place, 0 if there is none."""
        best, best_distance = 0, np.inf
        for number, known in self._known.items():
            last = known.last
            if last.session != sighting.session or number in taken:
                continue
            if self._groups.of(last.label) != self._groups.of(sighting.label):
                continue
            distance = float(np.linalg.norm(sighting.position - last.position))
            if distance < min(best_distance, self._reach(sighting, last)):
                best, best_distance = number, distance
        return best

    def _reach(self, sighting: Sighting, last: Sighting) -> float:
        """How far apart two sightings of one object may be: the middle of a large one wanders with the side seen."""
        params = self._params
        drift = params.odometry_drift * abs(sighting.travelled - last.travelled)
        wander = MIDDLE_WANDERS * min(sighting.extent, last.extent)
        return params.landmark_radius + wander + min(drift, params.landmark_radius)

    def _axes(self, sighting: Sighting, claims: Sequence[Link], here: int) -> Array:
        if claims:
            return np.asarray(claims[0].of.R_landmark_session @ claims[0].R_there_here)
        return self._known[here].last.R_landmark_session

    def _merge(self, old: int, new: int) -> None:
        gone = self._known.pop(old, None)
        if gone is None:
            return
        known = self._known.setdefault(new, gone)
        if known is gone:
            return
        known.votes.update(gone.votes)
        known.views.update(gone.views)

    def _spare(self, known: _Known) -> set[int]:
        """The keyframes that are left when the most diverse viewpoints are taken one after the other."""
        limit = self._params.max_views
        if len(known.views) <= limit:
            return set()
        keys = sorted(known.views)
        points = np.array([known.views[k] for k in keys])
        directions = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9)
        chosen = [len(keys) - 1]  # the newest stays: it shows the place as it is
        distance = np.full(len(keys), np.inf)
        while len(chosen) < limit:
            last = chosen[-1]
            step = np.linalg.norm(directions - directions[last], axis=1)
            step += 0.5 * np.abs(np.linalg.norm(points, axis=1) - np.linalg.norm(points[last]))
            distance = np.minimum(distance, step)
            distance[chosen] = -1.0
            chosen.append(int(distance.argmax()))
        return set(keys) - {keys[i] for i in chosen}


def _root(merged: dict[int, int], number: int) -> int:
    while number in merged:
        number = merged[number]
    return number


def _landmark(number: int, known: _Known) -> Landmark:
    return Landmark(
        landmark=number,
        label=max(known.votes, key=lambda label: (known.votes[label], label)),
        position=known.last.position,
        session=known.last.session,
        stamp_ns=known.last.stamp_ns,
        sightings=len(known.views),
    )
