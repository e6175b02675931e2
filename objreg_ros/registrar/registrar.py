# SPDX-License-Identifier: Apache-2.0
"""The room's one verb: frames in, closures and refusals out.

`Registrar.track` is the part for every frame, `Registrar.search` the part for every keyframe; they may run in two
threads, each in one. `Registrar.process` is both in a row: the same frames always give the same closures.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np

from objreg_ros.data import Array, Frame, LoopClosure, Reason, Rejected, Relocalised
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Clock, FrameWindow, Keyframer
from objreg_ros.memory.landmarks import Landmark, Landmarks
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.thinning import Thinning
from objreg_ros.registrar.candidate_search import Budget, Found, Means, Search
from objreg_ros.registrar.closure import (
    Accepted,
    Waiting,
    closure_of,
    links_of,
    observations,
    redundant,
    rejected,
    waiting_of,
)
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registration import gate_of, method_of
from objreg_ros.registration.api import Gate, Method
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrarParams

RECENT = 500  # landmarks that are told of after every keyframe


class Registrar:
    """Finds the loops. Holds the store at ``params.store`` until `close`; StoreError (an OSError) if that is bad.

    ``method`` finds poses between two keyframes and ``gate`` accepts or refuses them (`registration.api`); they are
    those of ``params`` where None. Both are called from several threads. What a gate of one's own refuses is refused:
    only what ours does waits for other keyframes to confirm it.
    """

    def __init__(self, params: RegistrarParams, method: Method | None = None, gate: Gate | None = None) -> None:
        self.params = self._adopted = params
        self._method, self._gate = method or method_of(params), gate
        self._confirm_seconds = params.confirm_seconds if gate is None else 0.0
        self._store, self._lock = Store(params.store), threading.RLock()
        self._pools: dict[int, ThreadPoolExecutor] = {}
        try:
            self._start(self._store.next_session())
        except BaseException:  # a damaged store: others may have it
            self.close()
            raise

    def _start(self, session: int) -> None:
        """Everything that lives in memory, from what is in the store; ``session`` is the first that is new."""
        self._keyframer, self._first_session = Keyframer(self.params, session), session
        self._index = Index(self.params)
        self._landmarks = Landmarks(self.params, first=self._store.next_landmark())
        self._index.add(self._landmarks.passing(self._store.sightings()))
        self._clock: Clock | None = None  # the run of the clock that goes on
        self._thinning = Thinning(self.params.thin_seconds)  # of what was accepted in it
        self._confirmation = Confirmation(self.params.replaced(confirm_seconds=self._confirm_seconds))
        self._since = 0  # the first session whose stamps are not of this run too
        self._relocalisation = Relocalisation()
        self._session: int | None = None  # the one that goes on, None before the first keyframe

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """Every known object with its id, label and position in the frame of its session, the oldest first."""
        with self._lock:
            return self._landmarks.known()

    @property
    def landmarks_here(self) -> tuple[Landmark, ...]:
        """The landmarks of late whose position is in the frame of the session that goes on now, at most `RECENT`."""
        with self._lock:
            return self._landmarks.recent(self._session, RECENT)

    @property
    def tracked(self) -> tuple[int, Array] | None:
        """See `Keyframer.tracked`."""
        return self._keyframer.tracked

    @property
    def waiting(self) -> int:
        """How many poses wait for other keyframes to confirm them."""
        return len(self._confirmation)

    @property
    def relocalised(self) -> Relocalised | None:
        """Where the newest frame is in the map of an earlier session of the store; None as `whereabouts` says."""
        return self._relocalisation.relocalised

    @property
    def whereabouts(self) -> str:
        """By what `relocalised` is known, or why it is not."""
        return self._relocalisation.reason

    def counts(self) -> dict[str, int]:
        """How many keyframes, objects, landmarks, sessions and closures are stored; how many ``forgotten`` by now."""
        with self._lock:
            return self._store.counts()

    def process(self, frame: Frame) -> Outcome:
        """Take in one frame: `track`, and `search` when it completed a keyframe."""
        window = self.track(frame)
        return Outcome() if window is None else self.search(window)

    def finish(self, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False) -> Outcome:
        """`search` for the keyframe that was still being collected, and settle what waits: the end of a recording."""
        window = self.end()
        return (Outcome() if window is None else self.search(window, seconds, hurried)).with_late(self.settle())

    def end(self) -> FrameWindow | None:
        """The frame window that was still being collected, None if it shows nothing new."""
        return self._keyframer.finish()

    def adopt(self, params: RegistrarParams) -> None:
        """Take what is live of the parameters, from the next frame and the next search on."""
        self._adopted = params

    def track(self, frame: Frame) -> FrameWindow | None:
        """Follow the camera; returns the frame window that became a keyframe with this one, mostly None."""
        self._keyframer.params = self._adopted
        window = self._keyframer.add(frame)
        self._relocalisation.follow(frame, self._keyframer.next_session - 1)
        return window

    def search(
        self, window: FrameWindow, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome:
        """Make a keyframe of the frame window, look for places that it shows again, and remember it.

        The likeliest places come first; those that are not begun within ``seconds``, or before ``hurried``, are refused
        as over budget: with no time the keyframe is only stored. Without a limit the outcome depends on the frames
        alone. Keyframes are numbered as they come here: in the order of their frames. StoreError where one cannot be
        stored; then it closes nothing. Of a frame window that a `reset` overtook nothing comes, nor of
        one whose objects have no name and were seen but once.
        """
        budget = Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            if window.session < self._first_session:  # `reset` came first
                return Outcome()
            self.params = self._index.params = self._adopted
            fused = fuse(window, self.params)
            if not fused.objects:
                return Outcome()
            keyframe = fused.numbered(self._store.next_keyframe())
            self._session = keyframe.session
            before = self._follow(window.clock, keyframe)
            sightings = sightings_of(keyframe)
            found = self._find_closures(keyframe, sightings, budget)
            try:
                closures, named = self._remember(keyframe, sightings, found.accepted)
            except StoreError:
                for item in found.accepted:
                    self._thinning.withdraw(item.target.stamp_ns, keyframe.stamp_ns)
                raise
            for number, item, refusal in found.held:
                self._confirmation.hold(number, waiting_of(keyframe, named, item, refusal, self.params))
            outcome = Outcome(
                closures=closures,
                rejected=(*before, *found.refused),
                keyframe_ns=keyframe.stamp_ns,
                observations=observations(keyframe, named),
                frame_id=keyframe.frame_id,
                session=keyframe.session,
            )
            return outcome.with_late(self._settled(keyframe.stamp_ns))

    def settle(self) -> Outcome:
        """Publish or refuse what still waits for other keyframes to confirm it: the end of a recording, or a save."""
        with self._lock:
            return self._settled(None)

    def reset(self) -> None:
        """Forget everything, in the store too; StoreError, and nothing is forgotten, where that cannot be."""
        with self._lock:
            self._store.clear()
            self._start(self._keyframer.next_session)

    def save(self, path: str = "") -> str:
        """Bring the store's file up to date, or write a copy of it to ``path``; returns where it is.
        StoreError where that cannot be, and without ``path`` where the store is in memory only.
        """
        with self._lock:
            return self._store.save(path)

    def close(self) -> None:
        """Let go of the store."""
        with self._lock:
            for pool in self._pools.values():
                pool.shutdown()
            self._store.close()

    def _pool(self) -> ThreadPoolExecutor:
        """The threads that try candidates for this one: as nice as it is, and kept, since each new one costs memory."""
        nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) if sys.platform == "linux" else 0
        if nice not in self._pools:
            self._pools[nice] = ThreadPoolExecutor(self.params.threads, "register")
        return self._pools[nice]

    def _follow(self, clock: Clock, keyframe: Keyframe) -> tuple[Rejected, ...]:
        """Where the clock began anew, leave out what an earlier run of it saw unless that was over by then.

        A stamp of it would name a moment of this run, and the session does not travel with a constraint.
        """
        if clock == self._clock:
            return ()
        given_up = self._settled(None).rejected
        last = self._store.last_session_beyond(clock.session, clock.began_ns)
        self._clock, self._thinning, self._since = clock, Thinning(self.params.thin_seconds), last + 1
        began = f"{1e-9 * clock.began_ns:.3f} s"
        refusal = Reason.CLOCK, f"the clock began anew at {began}; sessions up to {last} had seen that time before"
        return given_up if last < 0 else (*given_up, rejected(keyframe.stamp_ns, keyframe, refusal, keyframe))

    def _find_closures(self, keyframe: Keyframe, sightings: Sequence[Sighting], budget: Budget) -> Found:
        """What the stored keyframes that may show the same place come to; a refusal where none may."""
        candidates = self._index.query(sightings, self._since)
        if not candidates:
            refusal = Reason.NO_CANDIDATE, f"none of {len(self._index)} stored objects is alike and may be here"
            return Found([], [], [rejected(keyframe.stamp_ns, keyframe, refusal, keyframe)])
        means = Means(self._store, self._method, self._gate or gate_of(self.params), self._confirmation, self._pool())
        return Search(keyframe, self._thinning, budget, means, self.params).run(candidates)

    def _settled(self, now_ns: int | None) -> Outcome:
        """What waits no more: late constraints, and refusals."""
        confirmed, refused = self._confirmation.settle(now_ns)
        closures = []
        for waiting in confirmed:
            from_ns, to_ns = waiting.closure.from_ns, waiting.closure.to_ns
            if self._thinning.redundant(from_ns, to_ns):
                refused.append(waiting.refused(redundant(self.params.thin_seconds)))
                continue
            self._thinning.accept(from_ns, to_ns)
            closures.append(self._remember_late(waiting))
        return Outcome(closures=tuple(closures), rejected=tuple(refused))

    def _remember_late(self, waiting: Waiting) -> LoopClosure:
        """Write a late constraint down, and merge the landmarks that it says are one. It holds without that, too."""
        with suppress(StoreError, KeyError):  # the store fails, or has forgotten a keyframe of it meanwhile
            here, there = (
                {sighting.instance: sighting for sighting in self._store.sightings(number)}
                for number in (waiting.source_id, waiting.target_id)
            )
            pairs = [(here[a], there[b]) for a, b in waiting.pairs if a in here and b in there]
            merged = self._landmarks.joined(pairs, waiting.R_there_here)
            self._store.add_closure(waiting.closure, merged)
            self._landmarks.add((), merged)
            joined = {old: merge.into for old, merge in merged.items()}
            names = {instance: joined.get(seen.landmark, seen.landmark) for instance, seen in here.items()}
            waiting = waiting.renamed(names)
            ends = self._store.keyframe(waiting.source_id), self._store.keyframe(waiting.target_id)
            self._relocalisation.hear(waiting.closure, *ends)
        return waiting.closure

    def _remember(
        self, keyframe: Keyframe, sightings: Sequence[Sighting], accepted: Sequence[Accepted]
    ) -> tuple[tuple[LoopClosure, ...], tuple[Sighting, ...]]:
        """Give objects their landmarks and write all down; the closures, and the sightings with their landmarks."""
        stored = [list(self._store.sightings(item.target.keyframe_id)) for item in accepted]
        links = [link for item, seen in zip(accepted, stored, strict=True) for link in links_of(keyframe, item, seen)]
        named, merged = self._landmarks.assign(sightings, links)
        closures = tuple(closure_of(keyframe, named, item, self.params) for item in accepted)
        self._store.add(keyframe, named, closures, merged)
        self._landmarks.add(named, merged)
        self._index.add(named)
        for item, closure in zip(accepted, closures, strict=True):
            self._index.meet(keyframe.session, item.target.session)
            self._relocalisation.hear(closure, keyframe, item.target)
        with suppress(StoreError):  # the keyframe is stored: what is left now goes another time
            self._forget_surplus(named)
        return closures, named

    def _forget_surplus(self, named: Sequence[Sighting]) -> None:
        spare = self._landmarks.surplus(sighting.landmark for sighting in named)
        beyond = [k for k in self._store.beyond(self.params.max_keyframes) if k not in spare]
        spare += beyond
        if spare:
            self._store.remove(spare, forgotten=len(beyond))
            self._index.remove(spare)
            self._landmarks.forget(spare)
