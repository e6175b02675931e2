# SPDX-License-Identifier: Apache-2.0
"""The room's one verb: frames in, closures and refusals out.

`Registrar.track` is the part for every frame, `Registrar.search` the part for every keyframe; they may run in two
threads, each in one. `Registrar.process` is both in a row: the same frames always give the same closures. Frames of
several robots, and of several cameras of one, may come in turn. `Registrar.receive` takes keyframes of machines that
track by themselves.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from objreg_ros.data import Array, Frame, LoopClosure, Reason, Rejected, Relocalised
from objreg_ros.keyframes.frame_window import Arrival, Clock, FrameWindow, SessionNumbers
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.memory.landmarks import Landmark, Landmarks
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registrar.camera_track import CameraTrack, CameraTracks, clock_refusals
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
from objreg_ros.registrar.origins import Origins
from objreg_ros.registrar.outcome import Outcome, in_turn
from objreg_ros.registrar.pools import Pools
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
        self._pools = Pools(params.threads)
        try:
            self._start(self._store.next_session())
        except BaseException:  # a damaged store: others may have it
            self.close()
            raise

    def _start(self, session: int) -> None:
        """Everything that lives in memory, from what is in the store; ``session`` is the first that is new."""
        self._numbers, self._first_session = SessionNumbers(session), session
        self._origins = Origins(self._store, self._numbers)
        self._tracks = CameraTracks(self.params.replaced(confirm_seconds=self._confirm_seconds), self._numbers)
        self._index = Index(self.params)
        self._landmarks = Landmarks(self.params, first=self._store.next_landmark())
        self._index.add(self._landmarks.passing(self._store.sightings()))
        self._session: int | None = None  # of the newest keyframe, None before the first

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """Every known object with its id, label and position in the frame of its session, the oldest first."""
        with self._lock:
            return self._landmarks.known()

    @property
    def landmarks_here(self) -> tuple[Landmark, ...]:
        """The landmarks of late whose position is in the frame of the newest keyframe's session, at most `RECENT`."""
        with self._lock:
            return self._landmarks.recent(self._session, RECENT)

    @property
    def tracked(self) -> tuple[int, Array] | None:
        """See `Keyframer.tracked`, of the camera of the newest frame."""
        return self._tracks.followed.keyframer.tracked

    @property
    def waiting(self) -> int:
        """How many poses wait for other keyframes to confirm them."""
        return sum(len(track.confirmation) for track in tuple(self._tracks.values()))

    @property
    def relocalised(self) -> Relocalised | None:
        """Where the newest frame is in the map of an earlier session of the store; None as `whereabouts` says."""
        return self._tracks.followed.relocalisation.relocalised

    @property
    def whereabouts(self) -> str:
        """By what `relocalised` is known, or why it is not."""
        return self._tracks.followed.relocalisation.reason

    def counts(self) -> dict[str, int]:
        """How many keyframes, objects, landmarks, sessions and closures are stored; how many ``forgotten`` by now."""
        with self._lock:
            return self._store.counts()

    def process(self, frame: Frame) -> Outcome:
        """Take in one frame: `track`, and `search` when it completed a keyframe."""
        window = self.track(frame)
        return Outcome() if window is None else self.search(window)

    def finish(self, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False) -> Outcome:
        """`search` for the keyframes that were still being collected, and settle what waits: the end of a recording."""
        return in_turn([self.search(window, seconds, hurried) for window in self.end()]).with_late(self.settle())

    def end(self) -> list[FrameWindow]:
        """The frame windows that were still being collected, one a camera, without those that show nothing new."""
        return self._tracks.end()

    def adopt(self, params: RegistrarParams) -> None:
        """Take what is live of the parameters, from the next frame and the next search on."""
        self._adopted = params

    def track(self, frame: Frame) -> FrameWindow | None:
        """Follow the camera; returns the frame window that became a keyframe with this one, mostly None."""
        track = self._tracks.follow(frame)
        track.keyframer.params = self._adopted
        window = track.keyframer.add(frame)
        track.relocalisation.follow(frame, track.keyframer.session)
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
            keyframe = fuse(window, self.params)
            return self._search(keyframe, window.clock, budget) if keyframe.objects else Outcome()

    def receive(
        self, arrival: Arrival, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome | None:
        """`search` for a keyframe that a keyframer elsewhere has made; None for one that was received before."""
        budget = Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            self.params = self._index.params = self._adopted
            received = self._origins.received(arrival)
            return None if received is None else self._search(*received, budget)

    def _search(self, made: Keyframe, clock: Clock, budget: Budget) -> Outcome:
        keyframe, track = made.numbered(self._store.next_keyframe()), self._tracks.of(made.camera)
        self._session = keyframe.session
        before = self._follow(track, clock, keyframe)
        sightings = sightings_of(keyframe)
        found = self._find_closures(keyframe, sightings, track, budget)
        try:
            closures, named = self._remember(keyframe, sightings, found.accepted)
        except StoreError:
            for item in found.accepted:
                track.thinning.withdraw(item.target.session, item.target.stamp_ns, keyframe.stamp_ns)
            raise
        for number, item, refusal in found.held:
            track.confirmation.hold(number, waiting_of(keyframe, named, item, refusal, self.params))
        outcome = Outcome(
            closures=closures,
            rejected=(*before, *found.refused),
            keyframe_ns=keyframe.stamp_ns,
            observations=observations(keyframe, named),
            frame_id=keyframe.frame_id,
            session=keyframe.session,
            robot=keyframe.robot,
        )
        return outcome.with_late(self._settled(track, keyframe.stamp_ns))

    def settle(self) -> Outcome:
        """Publish or refuse what still waits for other keyframes to confirm it: the end of a recording, or a save."""
        with self._lock:
            return in_turn([self._settled(track, None) for track in tuple(self._tracks.values())])

    def reset(self) -> None:
        """Forget everything, in the store too; StoreError, and nothing is forgotten, where that cannot be."""
        with self._lock:
            self._store.clear()
            self._start(self._numbers.next)

    def save(self, path: str = "") -> str:
        """Bring the store's file up to date, or write a copy of it to ``path``; returns where it is.
        StoreError where that cannot be, and without ``path`` where the store is in memory only.
        """
        with self._lock:
            return self._store.save(path)

    def close(self) -> None:
        """Let go of the store."""
        with self._lock:
            self._pools.shutdown()
            self._store.close()

    def _follow(self, track: CameraTrack, clock: Clock, keyframe: Keyframe) -> tuple[Rejected, ...]:
        """Where the clock began anew, leave out what an earlier run of it saw unless that was over by then.

        A stamp of it would name a moment of this run, and the session does not travel with a constraint.
        """
        given_up: tuple[Rejected, ...] = ()
        if clock != track.clock:
            hidden = self._tracks.hidden_from(clock, keyframe.camera, self._store)
            given_up = self._settled(track, None).rejected + clock_refusals(clock, hidden, keyframe)
            track.begin(clock, hidden, self.params)
        track.see(keyframe)
        return given_up

    def _find_closures(
        self, keyframe: Keyframe, sightings: Sequence[Sighting], track: CameraTrack, budget: Budget
    ) -> Found:
        """What the stored keyframes that may show the same place come to; a refusal where none may."""
        candidates = self._index.query(sightings, track.hidden)
        if not candidates:
            refusal = Reason.NO_CANDIDATE, f"none of {len(self._index)} stored objects is alike and may be here"
            return Found([], [], [rejected(keyframe.stamp_ns, keyframe, refusal, keyframe)])
        gate, pool = self._gate or gate_of(self.params), self._pools.fitting()
        means = Means(self._store, self._method, gate, track.confirmation, pool)
        return Search(keyframe, track.thinning, budget, means, self.params).run(candidates)

    def _settled(self, track: CameraTrack, now_ns: int | None) -> Outcome:
        """What waits no more of a camera: late constraints, and refusals."""
        confirmed, refused = track.confirmation.settle(now_ns)
        closures = []
        for waiting in confirmed:
            from_ns, to_ns = waiting.closure.from_ns, waiting.closure.to_ns
            if track.thinning.redundant(waiting.from_session, from_ns, to_ns):
                refused.append(waiting.refused(redundant(self.params.thin_seconds)))
                continue
            track.thinning.accept(waiting.from_session, from_ns, to_ns)
            closures.append(self._remember_late(waiting, track))
        return Outcome(closures=tuple(closures), rejected=tuple(refused))

    def _remember_late(self, waiting: Waiting, track: CameraTrack) -> LoopClosure:
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
            track.relocalisation.hear(waiting.closure, *ends)
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
            self._tracks.of(keyframe.camera).relocalisation.hear(closure, keyframe, item.target)
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
