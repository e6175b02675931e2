# SPDX-License-Identifier: Apache-2.0
"""The closures between stores: each keyframe is searched for in the stores before its own, as a registrar does.

Retrieval, registration, gate and confirmation are those of the registrar. A leg is a part of a session; what was found
is written at its end, in one transaction, so that a merge which was interrupted goes on with a whole leg.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from objreg_ros.data.closures import LoopClosure
from objreg_ros.keyframes.frame_window import SessionNumbers
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.registrar.camera_track import CameraTrack
from objreg_ros.registrar.candidate_search import Budget, Means, Pools, Search
from objreg_ros.registrar.closure import WaitingClosure
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_ros.registration import gate_of, method_of
from objreg_ros.registration.keyframe import Keyframe

LEG = 256  # keyframes: so much work an interruption costs at most; what waits at its end is decided there
ENDLESS = Budget(inf, lambda: False)

Pair = tuple[int, int, int]  # the session and the stamp that a keyframe of a session is tied to, and its own stamp


@dataclass(frozen=True)
class Leg:
    """Keyframes of one session in their order, and the sessions in which they are not searched for."""

    session: int
    keyframe_ids: tuple[int, ...]
    hidden: frozenset[int]


def legs_of(store: Store, sessions: Sequence[Sequence[int]]) -> list[Leg]:
    """The search of a merged store, where ``sessions`` are those of each source in turn.

    Those of the first are searched for nowhere: the others are searched for in them.
    """
    keyframes: defaultdict[int, list[int]] = defaultdict(list)
    for head in store.heads():
        keyframes[head["session"]].append(head["id"])
    legs = []
    for k, own in enumerate(sessions[1:], start=1):
        hidden = frozenset(session for later in sessions[k:] for session in later)
        for session in own:
            ids = keyframes[session]
            legs += [Leg(session, tuple(ids[first : first + LEG]), hidden) for first in range(0, len(ids), LEG)]
    return legs


class FoundTies(Recollection):
    """A merged store with its index and landmarks. What is found waits until `write`."""

    def __init__(self, params: RegistrarParams, store: Store) -> None:
        super().__init__(params, store)
        self._pairs: defaultdict[int, list[Pair]] = defaultdict(list)  # by session
        self._found: list[WaitingClosure] = []
        for closure in store.closures():
            self._note(closure)

    def pairs_of(self, session: int) -> Sequence[Pair]:
        """What the keyframes of a session are tied to."""
        return self._pairs[session]

    def remember_late(self, waiting: WaitingClosure) -> tuple[WaitingClosure, tuple[Keyframe, Keyframe] | None]:
        """Keep a closure until `write`; it comes without its keyframes."""
        self._found.append(waiting)
        self._note(waiting.closure)
        return waiting, None

    def found(self) -> int:
        """How many closures wait to be written."""
        return len(self._found)

    def write(self) -> int:
        """Write what was found down, in one transaction, and join the landmarks that it says are one; how many."""
        merged: dict[int, Merge] = {}
        written = [self._joined(waiting, merged) for waiting in self._found]
        self.store.add_closures(written)
        self._found = []
        return sum(len(one) for _, one in written)

    def _joined(self, waiting: WaitingClosure, merged: dict[int, Merge]) -> tuple[LoopClosure, Mapping[int, Merge]]:
        """A closure under the ids that its objects have by now, and the landmarks that it joins.

        ``merged`` are those that were joined before and that the store does not know of yet.
        """
        here, there = (
            {one.instance: _by_now(one, merged) for one in self.store.sightings(number)}
            for number in (waiting.source_id, waiting.target_id)
        )
        pairs = [(here[a], there[b]) for a, b in waiting.pairs if a in here and b in there]
        new = self.landmarks.joined(pairs, waiting.R_there_here)
        self.landmarks.add_sightings((), new)
        merged |= new
        names = {a: _by_now(here[a], merged).landmark for a, _ in waiting.pairs if a in here}
        return waiting.renamed(names).closure, new

    def _note(self, closure: LoopClosure) -> None:
        one, other = closure.from_session, closure.to_session
        if one is None or other is None or one == other:
            return
        self._pairs[other].append((one, closure.from_ns, closure.to_ns))
        self._pairs[one].append((other, closure.to_ns, closure.from_ns))
        self.index.meet(other, one)


def _by_now(sighting: Sighting, merged: Mapping[int, Merge]) -> Sighting:
    """A sighting of the landmark that its own has become."""
    while (merge := merged.get(sighting.landmark)) is not None:
        sighting = sighting.of_landmark(merge.into, merge.R_into_old @ sighting.R_landmark_session)
    return sighting


class Tying:
    """Searches for keyframes of a merged store. Holds threads until `close`."""

    def __init__(self, store: Store, params: RegistrarParams) -> None:
        self._store, self._params = store, params
        self._ties = FoundTies(params, store)
        self._method, self._gate = method_of(params), gate_of(params)
        self._pools = Pools(params.threads)

    def close(self) -> None:
        """Let go of the threads; the store stays open."""
        self._pools.shutdown()

    def search(self, leg: Leg) -> Iterator[Counter[str]]:
        """Search for the keyframes of a leg; after each what came of it, and at the end what came of what waited.

        By name: ``tried`` pairs, ``closures``, and refusals by their reason.
        """
        track = CameraTrack(self._params, SessionNumbers())
        track.thinning.recall(self._ties.pairs_of(leg.session))
        for number in leg.keyframe_ids:
            yield self._search_for(number, leg, track)
        yield _counted(track.settle_waiting(None, self._ties))

    def found(self) -> int:
        """How many closures `write` will write."""
        return self._ties.found()

    def write(self) -> int:
        """Write down what a leg came to; how many landmarks became others."""
        return self._ties.write()

    def _search_for(self, number: int, leg: Leg, track: CameraTrack) -> Counter[str]:
        keyframe, named = self._store.keyframe(number), tuple(self._store.sightings(number))
        candidates = self._ties.index.query(named, leg.hidden) if named else []
        pool, vetoes = self._pools.fitting(), self._ties.vetoes
        means = Means(self._store, self._method, self._gate, track.confirmation, pool, vetoes)
        found = Search(keyframe, track.thinning, ENDLESS, means, self._params).run(candidates)
        track.wait_for_proof(found.accepted, keyframe, named)
        for decision in found.waiting:
            track.hold(decision, keyframe, named)
        counts = _counted(track.settle_waiting(keyframe.stamp_ns, self._ties))
        counts.update(f"refused: {refusal.reason.value}" for refusal in found.refused)
        return counts + Counter({"searched": 1, "offered": len(candidates), "waited": len(found.waiting)})


def _counted(outcome: Outcome) -> Counter[str]:
    refused = Counter(f"refused: {refusal.reason.value}" for refusal in outcome.rejected)
    return refused + Counter({"closures": len(outcome.closures)})
