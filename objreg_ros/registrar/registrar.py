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
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from objreg_ros.data import Array, Frame, LoopClosure, ObjectMatch, Observation, Reason, Rejected
from objreg_ros.geometry import transform
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Clock, FrameWindow, Keyframer
from objreg_ros.memory.landmarks import Landmark, Landmarks, Link
from objreg_ros.memory.retrieval import CandidateKeyframe, Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.thinning import Thinning
from objreg_ros.registration import align, method_of
from objreg_ros.registration.api import Gate, Method
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of
from objreg_ros.registration.gate.verdict import Refusal, judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.propose.prior import expect
from objreg_ros.registration.result import Registration, evidence_of

RECENT = 500  # landmarks that are told of after every keyframe


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a frame: accepted closures, refusals with reasons, and the keyframe that it completed, if any.

    With the objects of that keyframe under the ids of their landmarks.
    """

    closures: tuple[LoopClosure, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    keyframe_ns: int | None = None
    observations: tuple[Observation, ...] = ()
    frame_id: str = "camera"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Accepted:
    target: Keyframe
    candidate: Candidate


class _Budget(NamedTuple):
    """Until when new candidate keyframes are tried: a time of `time.monotonic`, or until ``hurried`` says so."""

    deadline: float
    hurried: Callable[[], bool]

    def over(self) -> str:
        """Why no more candidate keyframe is tried; empty while there is time."""
        late = time.monotonic() - self.deadline
        if late > 0:
            return f"{1e3 * late:.0f} ms after the end of the search"
        return "cut short: newer keyframes wait, or the node ends" if self.hurried() else ""


class _Search(NamedTuple):
    """The keyframe that candidate keyframes are sought for, the threads that try them, and how long."""

    keyframe: Keyframe
    pool: ThreadPoolExecutor
    budget: _Budget


_Try = tuple[CandidateKeyframe, Callable[[], _Accepted | Rejected] | None]
"""A candidate keyframe that is being tried, and what waits for its verdict."""


class Registrar:
    """Finds the loops. Holds the store at ``params.store`` until `close`; StoreError (an OSError) if that is bad.

    ``method`` finds poses between two keyframes and ``gate`` accepts or refuses them (`registration.api`); they are
    those of ``params`` and `judge` where None. Both are called from several threads.
    """

    def __init__(self, params: RegistrarParams, method: Method | None = None, gate: Gate | None = None) -> None:
        self.params = params
        self._method, self._gate = method or method_of(params), gate or judge
        self._store = Store(params.store)
        self._lock = threading.RLock()
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
        self._index.add(self._store.sightings())
        self._landmarks = Landmarks(self.params, self._store.sightings(), self._store.next_landmark())
        self._clock: Clock | None = None  # the run of the clock that goes on
        self._thinning = Thinning(self.params.thin_seconds)  # of what was accepted in it
        self._since = 0  # the first session whose stamps are not of this run too
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

    def counts(self) -> dict[str, int]:
        """How many ``keyframes``, ``objects``, ``landmarks``, ``sessions`` and ``closures`` the store holds.

        And how many keyframes were ``forgotten`` because there were more than ``max_keyframes``.
        """
        with self._lock:
            return self._store.counts()

    def process(self, frame: Frame) -> Outcome:
        """Take in one frame: `track`, and `search` when it completed a keyframe."""
        window = self.track(frame)
        return Outcome() if window is None else self.search(window)

    def finish(self) -> Outcome:
        """Search for the keyframe that was still being collected: the end of a recording."""
        window = self.end()
        return Outcome() if window is None else self.search(window)

    def end(self) -> FrameWindow | None:
        """The frame window that was still being collected, None if it shows nothing new."""
        return self._keyframer.finish()

    def track(self, frame: Frame) -> FrameWindow | None:
        """Follow the camera; returns the frame window that became a keyframe with this one, mostly None."""
        return self._keyframer.add(frame)

    def search(
        self, window: FrameWindow, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome:
        """Make a keyframe of the frame window, look for places that it shows again, and remember it.

        The likeliest places come first; those that are not begun within ``seconds``, or before ``hurried``, are refused
        as over budget: with no time the keyframe is only stored. Without a limit the outcome depends on the frames
        alone. Keyframes are numbered as they come here: in the order of their frames. StoreError where one cannot be
        stored; then it closes nothing. Of a frame window that a `reset` overtook nothing comes.
        """
        budget = _Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            if window.session < self._first_session:  # `reset` came first
                return Outcome()
            keyframe = fuse(window, self.params).numbered(self._store.next_keyframe())
            self._session = keyframe.session
            unnamed = self._follow(window.clock, keyframe)
            sightings = sightings_of(keyframe)
            accepted, rejected = self._try_candidates(keyframe, sightings, _Search(keyframe, self._pool(), budget))
            try:
                closures, named = self._remember(keyframe, sightings, accepted)
            except StoreError:
                for item in accepted:
                    self._thinning.withdraw(item.target.stamp_ns, keyframe.stamp_ns)
                raise
            seen = observations(keyframe, named)
            return Outcome(
                closures=closures,
                rejected=(*unnamed, *rejected),
                keyframe_ns=keyframe.stamp_ns,
                observations=seen,
                frame_id=keyframe.frame_id,
            )

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
        last = self._store.last_session_beyond(clock.session, clock.began_ns)
        self._clock, self._thinning, self._since = clock, Thinning(self.params.thin_seconds), last + 1
        began = f"{1e-9 * clock.began_ns:.3f} s"
        refusal = Reason.CLOCK, f"the clock began anew at {began}; sessions up to {last} had seen that time before"
        return () if last < 0 else (_rejected(keyframe.stamp_ns, keyframe, refusal),)

    def _try_candidates(
        self, keyframe: Keyframe, sightings: Sequence[Sighting], search: _Search
    ) -> tuple[list[_Accepted], tuple[Rejected, ...]]:
        """Try the stored keyframes that may show the same place, the likeliest first."""
        accepted: list[_Accepted] = []
        rejected: list[Rejected] = []
        queue = deque(self._index.query(sightings, self._since))
        if not queue:
            refusal = Reason.NO_CANDIDATE, f"none of {len(self._index)} stored objects is alike and may be here"
            rejected.append(_rejected(keyframe.stamp_ns, keyframe, refusal))
        tries, trying = self.params.candidates, deque[_Try]()
        while len(accepted) < self.params.closures:
            self._begin(search, queue, trying, tries, self.params.closures - len(accepted))
            if not trying:
                break
            stored, ask = trying.popleft()
            if ask is None or self._thinning.redundant(stored.stamp_ns, keyframe.stamp_ns):
                refusal = Reason.REDUNDANT, f"an accepted closure is nearer than {self.params.thin_seconds} s"
                rejected.append(_rejected(stored.stamp_ns, keyframe, refusal))
                continue
            tries -= 1
            verdict = ask()
            if isinstance(verdict, _Accepted):
                self._thinning.accept(stored.stamp_ns, keyframe.stamp_ns)
                accepted.append(verdict)
            else:
                rejected.append(verdict)
        return accepted, tuple(rejected)

    def _begin(
        self, search: _Search, queue: deque[CandidateKeyframe], trying: deque[_Try], tries: int, wanted: int
    ) -> None:
        """Begin to try the next candidates: as many at once as there are threads, and never more than ``tries``.

        While some are being tried, no more than would be ``wanted`` if all of them were accepted. What would say what
        is said already is put aside without a try. Verdicts are asked for in the order of the candidates, so it does
        not matter which is done first.
        """
        busy = sum(ask is not None for _, ask in trying)
        most = min(tries, self.params.threads if busy == 0 else min(wanted, self.params.threads))
        while queue and busy < most:
            stored = queue.popleft()
            redundant = self._thinning.redundant(stored.stamp_ns, search.keyframe.stamp_ns)
            trying.append((stored, None if redundant else self._try_candidate(search, stored)))
            busy += not redundant

    def _try_candidate(self, search: _Search, stored: CandidateKeyframe) -> Callable[[], _Accepted | Rejected]:
        """Begin to register a candidate keyframe in a thread of its own; what comes back waits for the verdict."""
        keyframe, over = search.keyframe, search.budget.over()
        if over:
            refusal = Reason.OVER_BUDGET, over
            return lambda: _rejected(stored.stamp_ns, keyframe, refusal)
        try:
            target = self._store.keyframe(stored.keyframe_id)
        except StoreError as error:
            refusal = Reason.UNREADABLE, str(error)
            return lambda: _rejected(stored.stamp_ns, keyframe, refusal)
        self._method.prepare(keyframe)
        prior = expect(keyframe, target, self.params)
        registered = search.pool.submit(align, keyframe, target, prior, self.params, self._method, self._gate)
        return lambda: _verdict(keyframe, target, registered.result())

    def _remember(
        self, keyframe: Keyframe, sightings: Sequence[Sighting], accepted: Sequence[_Accepted]
    ) -> tuple[tuple[LoopClosure, ...], tuple[Sighting, ...]]:
        """Give the objects their landmarks, write everything down, and forget what has become superfluous.

        Returns the closures, and the sightings with their landmarks.
        """
        links = [link for item in accepted for link in self._links(keyframe, item)]
        named, merged = self._landmarks.assign(sightings, links)
        closures = tuple(closure_of(keyframe, named, item, self.params) for item in accepted)
        self._store.add(keyframe, named, closures, merged)
        self._landmarks.add(named, merged)
        self._index.add(named)
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

    def _links(self, keyframe: Keyframe, item: _Accepted) -> list[Link]:
        stored = {sighting.instance: sighting for sighting in self._store.sightings(item.target.keyframe_id)}
        R_there_here = _rotation(item.target) @ item.candidate.T_target_source[:3, :3] @ _rotation(keyframe).T
        return [
            Link(
                index=pair.source, of=stored[item.target.objects[pair.target].cloud.instance], R_there_here=R_there_here
            )
            for pair in item.candidate.matched
        ]


def closure_of(
    keyframe: Keyframe, sightings: Sequence[Sighting], item: _Accepted, params: RegistrarParams
) -> LoopClosure:
    """The constraint of an accepted candidate; ``sightings`` are the keyframe's, with their landmarks."""
    candidate = item.candidate
    matches = tuple(
        ObjectMatch(label=pair.label, object_id=sightings[pair.source].landmark) for pair in candidate.matched
    )
    return LoopClosure(
        from_ns=item.target.stamp_ns,
        to_ns=keyframe.stamp_ns,
        T_from_to=candidate.T_target_source,
        covariance=covariance_of(candidate, params),
        labels=tuple(dict.fromkeys(match.label for match in matches)) or tuple(dict.fromkeys(keyframe.labels)),
        matches=matches,
        evidence=evidence_of(candidate) | _moved(keyframe, item),
        from_frame_id=item.target.frame_id,
        to_frame_id=keyframe.frame_id,
    )


def observations(keyframe: Keyframe, sightings: Sequence[Sighting]) -> tuple[Observation, ...]:
    """The objects of a keyframe under the ids of the landmarks that its ``sightings`` are of."""
    return tuple(
        Observation(label=sighting.label, object_id=sighting.landmark, xyz=item.centroid)
        for item, sighting in zip(keyframe.objects, sightings, strict=True)
    )


def _rejected(from_ns: int, keyframe: Keyframe, refusal: Refusal, T_from_to: Array | None = None) -> Rejected:
    reason, detail = refusal
    return Rejected(reason=reason, from_ns=from_ns, to_ns=keyframe.stamp_ns, detail=detail, T_from_to=T_from_to)


def _verdict(keyframe: Keyframe, target: Keyframe, registration: Registration) -> _Accepted | Rejected:
    candidate, reason = registration.candidate, registration.reason
    if reason is None and candidate is not None:
        return _Accepted(target=target, candidate=candidate)
    if reason is None:
        raise ValueError("gate: expected a reason with each refusal, got None")
    best = None if candidate is None else candidate.T_target_source
    return _rejected(target.stamp_ns, keyframe, (reason, registration.detail), best)


def _moved(keyframe: Keyframe, item: _Accepted) -> dict[str, float]:
    """How far the objects went that stand elsewhere now, under `MOVED`'s names; the farthest of several of one."""
    found: dict[str, float] = {}
    for pair in item.candidate.moved:
        here = transform(item.candidate.T_target_source, keyframe.objects[pair.source].centroid)
        metres = float(np.linalg.norm(here - item.target.objects[pair.target].centroid))
        name = f"moved {pair.label} [m]"
        found[name] = max(metres, found.get(name, 0.0))
    return found


def _rotation(keyframe: Keyframe) -> Array:
    return np.eye(3) if keyframe.T_odom_camera is None else keyframe.T_odom_camera[:3, :3]
