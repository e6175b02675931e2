# SPDX-License-Identifier: Apache-2.0
"""Objects of the place with ids that stay: the same cup has the same id in every keyframe and session.

Two sightings are the same landmark where they are at the same place in the same session, or where a closure put them
upon each other. When a closure shows that two landmarks are one, the older id stays, and its axes. A closure
counts for more than a place, which drifts with the session; and two that one keyframe shows together are never one.
"""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import islice, product
from math import prod

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.known import Known, Last, last_of
from objreg_ros.memory.params import MemoryParams
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.labels import LabelGroups

RADIUS_M = 0.1  # an object seen again within this is the same landmark
MIDDLE_WANDERS = 0.2  # of the extent
CELL = 0.5  # m, edge of the cells that know which landmarks are there

Cell = tuple[int, str, int, int, int]  # session, label group, and where


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Landmark:
    """A known object: ``position (3,)`` m in the frame of the ``session`` of ``robot`` that saw it last.

    It was seen so at ``stamp_ns``.
    """

    landmark: int
    label: str
    position: Array
    session: int
    stamp_ns: int
    sightings: int
    robot: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Link:
    """A closure's statement that object ``index`` of the new keyframe is the stored sighting ``of``.

    ``R_there_here (3, 3)`` turns the axes of the new keyframe's session into those of the stored one's.
    """

    index: int
    of: Sighting
    R_there_here: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Merge:
    """What became of a landmark that turned out to be ``into``, an older one.

    ``R_into_old (3, 3)`` turns the axes of the one that is gone into those of the one that stays.
    """

    into: int
    R_into_old: Array


class Landmarks:
    """All known objects. Deterministic: the same sightings in the same order give the same ids.

    ``first`` is the id of the first new one. What a keyframe costs here does not grow with the number of landmarks.
    """

    def __init__(self, params: MemoryParams, sightings: Iterable[Sighting] = (), first: int = 1) -> None:
        self._params = params
        self._groups = LabelGroups(params.label_groups)
        self._known: dict[int, Known] = {}  # the one seen last comes last
        self._there: defaultdict[Cell, set[int]] = defaultdict(set)
        self._shown: dict[int, array[int]] = {}  # the landmarks of each keyframe
        self._next = first
        self.add_sightings(sightings)

    def __len__(self) -> int:
        return len(self._known)

    def known(self) -> tuple[Landmark, ...]:
        """Every landmark, the oldest first."""
        return tuple(_landmark(number, known) for number, known in sorted(self._known.items()))

    def recent(self, session: int | None, most: int) -> tuple[Landmark, ...]:
        """Of the ``most`` landmarks that were seen last those of this session, the oldest first."""
        last = sorted(islice(reversed(self._known), most))
        return tuple(_landmark(n, self._known[n]) for n in last if self._known[n].last.session == session)

    def placed(self, sessions: Collection[int], most: int) -> list[tuple[int, Last, int]]:
        """Of the ``most`` landmarks that were seen last those whose place is known in one of these sessions.

        Each with its latest sighting and the number of keyframes that show it; the one seen last comes first.
        """
        last = ((number, self._known[number]) for number in islice(reversed(self._known), most))
        return [(number, known.last, len(known.views)) for number, known in last if known.last.session in sessions]

    def assign(
        self, sightings: Sequence[Sighting], links: Sequence[Link] = ()
    ) -> tuple[tuple[Sighting, ...], dict[int, Merge]]:
        """The sightings of a new keyframe with their landmarks, and which landmarks turned out to be which older.

        A landmark is one object of a keyframe at most: of two that closures put upon it the first has it.
        """
        merged: dict[int, Merge] = {}
        named: list[Sighting] = []
        taken: set[int] = set()
        for index, sighting in enumerate(sightings):
            axes = self._axes(index, sighting, links, taken)
            if not axes:
                named.append(sighting.of_landmark(self._next, np.eye(3)))
                self._next += 1
                continue
            oldest = min(axes)
            merged |= {n: Merge(into=oldest, R_into_old=axes[oldest] @ R.T) for n, R in axes.items() if n != oldest}
            taken |= axes.keys()
            named.append(sighting.of_landmark(oldest, axes[oldest]))
        return tuple(named), merged

    def joined(self, pairs: Iterable[tuple[Sighting, Sighting]], R_there_here: Array) -> dict[int, Merge]:
        """Which landmarks become which older, where a late closure says that each of ``pairs`` is one object.

        Each pair is a sighting of the later keyframe and one of the earlier; ``R_there_here`` as in `Link`. Two that
        some keyframe shows together stay two.
        """
        merged: dict[int, Merge] = {}
        touched: set[int] = set()
        for here, there in pairs:
            two = {here.landmark, there.landmark}
            if len(two) == 1 or two & touched or self._shown_beside(max(two), two):
                continue
            R_there = there.R_landmark_session @ R_there_here @ here.R_landmark_session.T  # from here's axes
            newer = here.landmark > there.landmark
            into, R = (there.landmark, R_there) if newer else (here.landmark, R_there.T)
            merged[max(two)] = Merge(into=into, R_into_old=R)
            touched |= two
        return merged

    def add_sightings(self, sightings: Iterable[Sighting], merged: Mapping[int, Merge] | None = None) -> None:
        """Take in sightings that have their landmarks, after merging the landmarks that turned out to be one."""
        for old, merge in (merged or {}).items():
            self._merge(old, merge)
        for sighting in sightings:
            number, last = sighting.landmark, last_of(sighting)
            known = self._known.pop(number) if number in self._known else Known(last)
            self._known[number] = known  # at the end: seen last
            self._leave(known.last, number)
            self._there[self._cell(last)].add(number)
            known.last = last
            known.votes[last.label] += round(1000 * sighting.score)
            known.views[sighting.keyframe_id] = sighting.viewpoint
            shown = self._shown.setdefault(sighting.keyframe_id, array("q"))
            if number not in shown:
                shown.append(number)
            self._next = max(self._next, number + 1)

    def passing(self, sightings: Iterable[Sighting]) -> Iterator[Sighting]:
        """The sightings as they come, each taken in on its way to what else needs it: a store is read but once."""
        for sighting in sightings:
            self.add_sightings((sighting,))
            yield sighting

    def surplus(self, landmarks: Iterable[int]) -> list[int]:
        """Keyframes of these landmarks that show each of their objects from where better spread keyframes do too."""
        spare = {
            number: self._known[number].spare(self._params.max_views)
            for number in set(landmarks)
            if number in self._known
        }
        spared = set().union(*spare.values()) if spare else set()
        return sorted(k for k in spared if all(k in spare.get(number, ()) for number in self._shown.get(k, ())))

    def forget_keyframes(self, keyframe_ids: Iterable[int]) -> None:
        """Forget from where these keyframes saw their objects, and the landmarks that no other keyframe shows."""
        for keyframe_id in keyframe_ids:
            for number in self._shown.pop(keyframe_id, ()):
                known = self._known[number]
                del known.views[keyframe_id]
                if not known.views:
                    self._leave(known.last, number)
                    del self._known[number]

    def _leave(self, last: Last, number: int) -> None:
        """A landmark is no longer where it was seen so."""
        cell = self._cell(last)
        self._there[cell].discard(number)
        if not self._there[cell]:
            del self._there[cell]

    def _same_place(self, sighting: Sighting, taken: set[int]) -> int:
        """The landmark that this session saw last at this place, 0 if there is none."""
        best, best_distance = 0, np.inf
        for number in sorted(self._near(sighting) - taken):
            last = self._known[number].last
            distance = float(np.linalg.norm(sighting.position - last.position))
            if distance < min(best_distance, self._reach(sighting, last)):
                best, best_distance = number, distance
        return best

    def _near(self, sighting: Sighting) -> set[int]:
        """The landmarks of the sighting's session and label group that may be within reach of it.

        An object may be so large that fewer cells are known than it reaches.
        """
        reach = 2.0 * RADIUS_M + MIDDLE_WANDERS * sighting.extent  # the largest that it can be
        low, high = (np.floor((sighting.position + side * reach) / CELL).astype(int) for side in (-1, 1))
        session, group, *_ = self._cell(sighting)
        spans = [range(a, b + 1) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
        if prod(map(len, spans)) > len(self._there):
            return set().union(*(there for cell, there in self._there.items() if cell[:2] == (session, group)))
        return set().union(*(self._there.get((session, group, x, y, z), ()) for x, y, z in product(*spans)))

    def _cell(self, sighting: Sighting | Last) -> Cell:
        x, y, z = np.floor(sighting.position / CELL).astype(int).tolist()
        return sighting.session, self._groups.of(sighting.label), x, y, z

    def _reach(self, sighting: Sighting, last: Last) -> float:
        """How far apart two sightings of one object may be: the middle of a large one wanders with the side seen."""
        params = self._params
        drift = params.odometry_drift * abs(sighting.travelled - last.travelled)
        wander = MIDDLE_WANDERS * min(sighting.extent, last.extent)
        return RADIUS_M + wander + min(drift, RADIUS_M)

    def _axes(self, index: int, sighting: Sighting, links: Sequence[Link], taken: Set[int]) -> dict[int, Array]:
        """The landmarks that an object of a new keyframe is, each with what turns the session's axes into its own.

        Those that closures claim for it come first. The place adds one only if no closure claims that for another
        object, and of two that some keyframe shows together only the first is believed.
        """
        found: dict[int, Array] = {}
        for link in links:
            number = link.of.landmark
            if link.index == index and number not in taken and not self._shown_beside(number, found):
                found.setdefault(number, link.of.R_landmark_session @ link.R_there_here)
        claimed = {link.of.landmark for link in links if link.index != index}
        here = self._same_place(sighting, claimed | taken)
        if here and here not in found and not self._shown_beside(here, found):
            found[here] = self._known[here].last.R_landmark_session
        return found

    def _shown_beside(self, number: int, others: Iterable[int]) -> bool:
        """Whether some keyframe shows a landmark together with another one of ``others``."""
        mine = frozenset(self._known[number].views) if number in self._known else frozenset()
        return any(
            other != number and other in self._known and not mine.isdisjoint(self._known[other].views)
            for other in others
        )

    def _merge(self, old: int, merge: Merge) -> None:
        gone, new = self._known.pop(old, None), merge.into
        if gone is None:
            return
        self._leave(gone.last, old)
        gone.last.numbers[3:12] = (merge.R_into_old @ gone.last.R_landmark_session).ravel()
        for keyframe_id, view in gone.views.items():
            gone.views[keyframe_id] = merge.R_into_old @ view
        known = self._known.setdefault(new, gone)
        if max(gone.views) > max(known.views):  # the one that is gone was seen last
            self._leave(known.last, new)
            known.last = gone.last
            self._known[new] = self._known.pop(new)
        self._there[self._cell(known.last)].add(new)
        for keyframe_id in gone.views:
            self._shown[keyframe_id] = array("q", {*self._shown[keyframe_id]} - {old} | {new})
        if known is not gone:
            known.votes.update(gone.votes)
            known.views.update(gone.views)


def _landmark(number: int, known: Known) -> Landmark:
    return Landmark(
        landmark=number,
        label=max(known.votes, key=lambda label: (known.votes[label], label)),
        position=known.last.position,
        session=known.last.session,
        stamp_ns=known.last.stamp_ns,
        sightings=len(known.views),
        robot=known.last.robot,
    )
