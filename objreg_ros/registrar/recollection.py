# SPDX-License-Identifier: Apache-2.0
"""The store, and what is known of it in memory: the index of its objects, and their landmarks. They keep in step."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registrar.closure import Decision, WaitingClosure, closure_of, links_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe


class Recollection:
    """What ``store`` holds, with its ``index`` and ``landmarks``, by ``params`` that may change."""

    def __init__(self, params: RegistrarParams, store: Store) -> None:
        self._params, self.store = params, store
        self.index = Index(params)
        self.landmarks = Landmarks(params, first=store.next_landmark())
        self.index.add_objects(self.landmarks.passing(store.sightings()))

    @property
    def params(self) -> RegistrarParams:
        """Those that hold now."""
        return self._params

    @params.setter
    def params(self, params: RegistrarParams) -> None:
        self._params = self.index.params = params

    def remember(
        self, keyframe: Keyframe, sightings: Sequence[Sighting], accepted: Sequence[Decision]
    ) -> tuple[tuple[LoopClosure, ...], tuple[Sighting, ...]]:
        """Give objects their landmarks and write all down; the closures, and the sightings with their landmarks."""
        stored = [list(self.store.sightings(decision.target.keyframe_id)) for decision in accepted]
        links = [
            link for decision, seen in zip(accepted, stored, strict=True) for link in links_of(keyframe, decision, seen)
        ]
        named, merged = self.landmarks.assign(sightings, links)
        closures = tuple(closure_of(keyframe, named, decision, self.params) for decision in accepted)
        self.store.write_keyframe(keyframe, named, closures, merged)
        self.landmarks.add_sightings(named, merged)
        self.index.add_objects(named)
        self._meet(keyframe, accepted)
        with suppress(StoreError):  # the keyframe is stored: what is left now goes another time
            self._forget_surplus(named)
        return closures, named

    def remember_closures(self, keyframe: Keyframe, accepted: Sequence[Decision]) -> tuple[LoopClosure, ...]:
        """Write the closures to a keyframe that others store down. They hold without that, too.

        What the keyframe shows joins no landmarks of this store.
        """
        closures = tuple(
            closure_of(keyframe, self.as_known(keyframe, decision), decision, self.params) for decision in accepted
        )
        with suppress(StoreError):
            for closure in closures:
                self.store.add_closure(closure, {})
        self._meet(keyframe, accepted)
        return closures

    def as_known(self, keyframe: Keyframe, decision: Decision) -> tuple[Sighting, ...]:
        """The objects of a keyframe that others store, with the landmarks of the stored ones that they are; else 0."""
        named = list(sightings_of(keyframe))
        for link in links_of(keyframe, decision, list(self.store.sightings(decision.target.keyframe_id))):
            named[link.index] = named[link.index].of_landmark(link.of.landmark, np.eye(3))
        return tuple(named)

    def ties_of(self, camera: tuple[str, str]) -> list[tuple[int, int, int]]:
        """Session and stamp of the stored keyframe, and stamp of the other, of each closure to a robot's camera."""
        try:
            ties = [one for one in self.store.closures() if (one.to_robot, one.to_frame_id) == camera]
        except StoreError:  # what is damaged is reported where it is used
            return []
        return [(one.from_session, one.from_ns, one.to_ns) for one in ties if one.from_session is not None]

    def remember_late(self, waiting: WaitingClosure) -> tuple[WaitingClosure, tuple[Keyframe, Keyframe] | None]:
        """Write a late constraint down, and merge the landmarks that it says are one. It holds without that, too.

        It comes with its keyframes, the new one and the stored; without them where one is not in the store.
        """
        with suppress(StoreError, KeyError):  # the store fails, or has forgotten a keyframe of it meanwhile
            here, there = (
                {sighting.instance: sighting for sighting in self.store.sightings(number)}
                for number in (waiting.source_id, waiting.target_id)
            )
            pairs = [(here[a], there[b]) for a, b in waiting.pairs if a in here and b in there]
            merged = self.landmarks.joined(pairs, waiting.R_there_here)
            self.store.add_closure(waiting.closure, merged)
            self.landmarks.add_sightings((), merged)
            joined = {old: merge.into for old, merge in merged.items()}
            seen = {a: here.get(a, there.get(b)) for a, b in waiting.pairs}
            names = {a: joined.get(one.landmark, one.landmark) for a, one in seen.items() if one is not None}
            waiting = waiting.renamed(names)
            return waiting, (self.store.keyframe(waiting.source_id), self.store.keyframe(waiting.target_id))
        return waiting, None

    def _meet(self, keyframe: Keyframe, accepted: Sequence[Decision]) -> None:
        for decision in accepted:
            self.index.meet(keyframe.session, decision.target.session)

    def _forget_surplus(self, named: Sequence[Sighting]) -> None:
        spare = self.landmarks.surplus(sighting.landmark for sighting in named)
        most = self.params.max_keyframes, 1e6 * self.params.max_megabytes
        beyond = [number for number in self.store.beyond(*most) if number not in spare]
        spare += beyond
        if spare:
            self.store.remove(spare, forgotten=len(beyond))
            self.index.remove(spare)
            self.landmarks.forget_keyframes(spare)
