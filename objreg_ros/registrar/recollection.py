# SPDX-License-Identifier: Apache-2.0
"""The store, and what is known of it in memory: the index of its objects, and their landmarks. They keep in step."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Container, Sequence
from contextlib import closing, suppress

import numpy as np

from objreg_ros.data.closure_id import closure_id, id_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.veto import Stand, Stands, Veto
from objreg_ros.registrar.closure import Decision, WaitingClosure, closure_of, links_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.keyframe import Keyframe

MOST_ELSEWHERE = 4096  # keyframes that others store, of which it is known where they stood


class Recollection:
    """What ``store`` holds, with its ``index`` and ``landmarks``, by ``params`` that may change."""

    def __init__(self, params: RegistrarParams, store: Store) -> None:
        self._params, self.store = params, store
        self.index = Index(params)
        self.landmarks = Landmarks(params, first=store.next_landmark())
        self.index.add_objects(self.landmarks.passing(store.sightings()))
        self.vetoes = Vetoes(store.vetoes())
        self._elsewhere = OrderedDict[tuple[int, int], Stand]()  # by session and stamp, of keyframes that others store

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
        self._elsewhere[keyframe.session, keyframe.stamp_ns] = Stand.of(keyframe)
        while len(self._elsewhere) > MOST_ELSEWHERE:
            self._elsewhere.popitem(last=False)
        named = list(sightings_of(keyframe))
        for link in links_of(keyframe, decision, list(self.store.sightings(decision.target.keyframe_id))):
            named[link.index] = named[link.index].of_landmark(link.of.landmark, np.eye(3))
        return tuple(named)

    def named(self, ids: Sequence[str], robot: str, vetoed: bool) -> list[LoopClosure]:
        """The closures of these ids among those that hold, or that are ``vetoed``. ValueError for an id of none.

        ``robot`` is that of closures that name none. StoreError where the store is damaged.
        """
        if vetoed:
            withdrawn = {closure_id(veto.closure, robot): veto.closure for veto in self.vetoes}
            return [withdrawn[name] for name in _known(ids, withdrawn, "withdrawn")]
        numbers = self._numbers(frozenset(ids), robot)
        return list(self.store.closures([numbers[name] for name in _known(ids, numbers, "stored")]))

    def _numbers(self, ids: frozenset[str], robot: str) -> dict[str, int]:
        """The numbers of the stored closures of these ids, of which there may be fewer. Ends with the last of them."""
        found = dict[str, int]()
        with closing(self.store.closure_numbers()) as numbers:
            for identity, number in numbers:
                if len(found) == len(ids):
                    break
                if (name := id_of(identity, robot)) in ids:
                    found.setdefault(name, number)
        return found

    def veto(self, closures: Sequence[LoopClosure]) -> list[Veto]:
        """Withdraw stored closures: they are not found again. StoreError where that cannot be written."""
        return self.take_vetoes([Veto(closure=closure, stands=self._stands(closure)) for closure in closures])

    def take_vetoes(self, vetoes: Sequence[Veto]) -> list[Veto]:
        """Take in vetoes, of this registrar or another. StoreError where that cannot be written."""
        self.store.veto(vetoes)
        for veto in vetoes:
            self.vetoes.add(veto)
        return list(vetoes)

    def undo_veto(self, closures: Sequence[LoopClosure]) -> None:
        """Let withdrawn closures hold again. StoreError where that cannot be written."""
        self.store.undo_veto([veto for veto in self.vetoes if veto.closure in closures])
        for closure in closures:
            self.vetoes.remove(closure)

    def ends_of(self, closure: LoopClosure) -> tuple[Keyframe, Keyframe] | None:
        """The keyframes of a closure, the later one first; None where one is not stored or is damaged."""
        there = self.store.keyframe_at(closure.from_session, closure.from_ns)
        here = self.store.keyframe_at(closure.to_session, closure.to_ns)
        with suppress(StoreError):
            if there is not None and here is not None:
                return self.store.keyframe(here), self.store.keyframe(there)
        return None

    def _stands(self, closure: LoopClosure) -> Stands:
        return (
            self._stand(closure.from_session, closure.from_ns),
            self._stand(closure.to_session, closure.to_ns),
        )

    def _stand(self, session: int | None, stamp_ns: int) -> Stand | None:
        if session is not None and (session, stamp_ns) in self._elsewhere:
            return self._elsewhere[session, stamp_ns]
        return self.store.stand_at(session, stamp_ns)

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


def _known(ids: Sequence[str], known: Container[str], what: str) -> list[str]:
    """The ids, each once. ValueError for one that is not known."""
    lacking = [name for name in ids if name not in known]
    if not ids or lacking:
        raise ValueError(f"ids: expected those of {what} closures, got {', '.join(lacking)[:200] or 'none'}")
    return list(dict.fromkeys(ids))
