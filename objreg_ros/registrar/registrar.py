# SPDX-License-Identifier: Apache-2.0
"""Frames in, closures and refusals out.

`Registrar.track` is the part for every frame, `Registrar.search` the part for every keyframe; they may run in two
threads, each in one. `Registrar.process` is both in a row: the same frames always give the same closures. Frames of
several robots and cameras may come in turn. `Registrar.receive_keyframe` takes keyframes of machines that track by
themselves.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Reason, Rejected, Relocalised
from objreg_ros.data.frames import Frame
from objreg_ros.data.localisation import LocalisationState
from objreg_ros.keyframes.frame_window import Arrival, Clock, FrameWindow, SessionNumbers
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.memory.landmarks import Landmark
from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.camera_track import CameraTrack, CameraTracks
from objreg_ros.registrar.candidate_search import Budget, Found, Means, Pools, Search
from objreg_ros.registrar.closure import Decision, observations, rejected
from objreg_ros.registrar.known_objects import KnownObjects, objects_called
from objreg_ros.registrar.localisation.localisation import EXPECTED
from objreg_ros.registrar.localisation.search import search_elsewhere, weigh_contrary
from objreg_ros.registrar.origins import Origins
from objreg_ros.registrar.outcome import Outcome, in_turn
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_ros.registration import gate_of, method_of
from objreg_ros.registration.api import Gate, Method
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.terminal import progress

RECENT = 500  # landmarks that are reported after every keyframe


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
        self._lock = threading.RLock()
        with progress(f"opening the store {params.store}".rstrip()):
            self._store = Store(params.store)
        self._pools = Pools(params.threads)
        try:
            with progress("reading the objects of the store"):
                self._start(self._store.next_session())
        except BaseException:  # a damaged store: others may have it
            self.close()
            raise

    def _start(self, session: int) -> None:
        """Everything that lives in memory, from what is in the store; ``session`` is the first that is new."""
        self._numbers, self._first_session = SessionNumbers(session), session
        self._origins = Origins(self._store, self._numbers)
        self._tracks = CameraTracks(self.params.replaced(confirm_seconds=self._confirm_seconds), self._numbers)
        self._recollection = Recollection(self.params, self._store)
        self._session: int | None = None  # of the newest keyframe, None before the first

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """Every known object with its id, label and position in the frame of its session, the oldest first."""
        with self._lock:
            return self._recollection.landmarks.known()

    @property
    def landmarks_here(self) -> tuple[Landmark, ...]:
        """The landmarks of late whose position is in the frame of the newest keyframe's session, at most `RECENT`."""
        with self._lock:
            return self._recollection.landmarks.recent(self._session, RECENT)

    def where(self, label: str) -> KnownObjects:
        """Where the objects of a label are in the frame of the newest keyframe's session, as `objects_called` says it.

        StoreError where the store cannot be read.
        """
        with self._lock:
            sightings = partial(self._store.sightings, None)
            known = self._tracks.followed.keyframer.session == self._session  # else it is of a newer session
            return objects_called(label, self.landmarks, sightings, self._session, self.relocalised if known else None)

    @property
    def tracked(self) -> tuple[int, Array] | None:
        """See `Keyframer.tracked`, of the camera of the newest frame."""
        return self._tracks.followed.keyframer.tracked

    @property
    def waiting(self) -> int:
        """How many poses wait for other keyframes to confirm them."""
        return sum(len(track.confirmation) for track in self._tracks.all())

    @property
    def relocalised(self) -> Relocalised | None:
        """Where the newest frame is in the map of an earlier session of the store; None as `whereabouts` says."""
        return self._tracks.followed.relocalisation.relocalised

    @property
    def whereabouts(self) -> str:
        """By what `relocalised` is known, or why it is not."""
        return self._tracks.followed.relocalisation.reason

    @property
    def localisation(self) -> LocalisationState | None:
        """How sure it is of where the camera of the newest frame is; None before the first frame."""
        track = self._tracks.followed
        return None if track.keyframer.session < 0 else track.localisation.state(track.relocalisation.newest_ns)

    def counts(self) -> dict[str, int]:
        """How many keyframes, objects, landmarks, sessions and closures are stored, and how many are forgotten."""
        with self._lock:
            return self._store.counts()

    def process(self, frame: Frame) -> Outcome:
        """Take in one frame: `track`, and `search` when it completed a keyframe."""
        return Outcome() if (window := self.track(frame)) is None else self.search(window)

    def finish(self, doubt: str = "") -> Outcome:
        """`search` for the keyframes that were being collected, `release` and `settle`: the end of a recording."""
        outcomes = [
            self._tracks.refuse(window, doubt) if doubt else self.search(window) for window in self.end_windows()
        ]
        return in_turn(outcomes).with_late(self.release(doubt)).with_late(self.settle())

    def end_windows(self) -> list[FrameWindow]:
        """The frame windows that were still being collected, one a camera, without those that show nothing new."""
        return self._tracks.finish_windows()

    def use_parameters(self, params: RegistrarParams) -> None:
        """Take what is live of the parameters, from the next frame and the next search on."""
        self._adopted = params

    def track(self, frame: Frame) -> FrameWindow | None:
        """Follow the camera; returns the frame window that became a keyframe with this one, mostly None."""
        track = self._tracks.track_of(frame)
        track.keyframer.params = self._adopted
        window = track.keyframer.add_frame(frame)
        track.relocalisation.note_frame(frame, track.keyframer.session)
        return window

    def search(
        self, window: FrameWindow, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome:
        """Make a keyframe of the frame window, look for places that it shows again, and remember it.

        The likeliest places come first; those that are not begun within ``seconds``, or before ``hurried``, are refused
        as over budget: with no time the keyframe is only stored. Without a limit the outcome depends on the frames
        alone. Keyframes are numbered as they come here: in the order of their frames. StoreError where one cannot be
        stored; then it closes nothing. Of a frame window that a `reset` overtook nothing comes, nor of one whose
        objects have no name and were seen but once. One whose camera is in doubt is refused, and not stored.
        """
        budget = Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            if window.session < self._first_session:  # `reset` came first
                return Outcome()
            self.params = self._recollection.params = self._adopted
            if window.doubt:
                return self._tracks.refuse(window, window.doubt)
            keyframe = fuse(window, self.params)
            return self._close_loops(keyframe, window.clock, budget, window.proven) if keyframe.objects else Outcome()

    def receive_keyframe(
        self, arrival: Arrival, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome | None:
        """`search` for a keyframe of a keyframer elsewhere, if it has objects; None for one that came before."""
        if not arrival.keyframe.objects:
            return Outcome()
        budget = Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            self.params = self._recollection.params = self._adopted
            received = self._origins.received(arrival)
            return None if received is None else self._close_loops(*received, budget)

    def _close_loops(self, made: Keyframe, clock: Clock, budget: Budget, proven: bool = True) -> Outcome:
        """The five steps of a keyframe: track, retrieve, register, judge, remember."""
        keyframe, track = made.numbered(self._store.next_keyframe()), self._tracks.of(made.camera)
        given_up = self._follow(keyframe, clock, track, proven)
        sightings = sightings_of(keyframe)
        self._expect(keyframe, track)
        candidates = self._recollection.index.query(sightings, track.hidden)
        found = self._register(candidates, keyframe, track, budget) if candidates else self._none_alike(keyframe)
        believed = found.accepted if track.proven else []
        closures, named = self._remember(keyframe, sightings, believed, found, track)
        track.localisation.set_alike(found.alike)
        self._localise(keyframe, named, track, budget)
        outcome = Outcome(
            closures=closures,
            rejected=(*given_up, *found.refused),
            keyframe_ns=keyframe.stamp_ns,
            keyframe_id=keyframe.keyframe_id,
            observations=observations(keyframe, named),
            frame_id=keyframe.frame_id,
            session=keyframe.session,
            robot=keyframe.robot,
        )
        return outcome.with_late(track.settle_waiting(keyframe.stamp_ns, self._recollection))

    def _follow(self, keyframe: Keyframe, clock: Clock, track: CameraTrack, proven: bool) -> tuple[Rejected, ...]:
        """Go on to the keyframe; what is given up where the clock of its camera began anew."""
        track.proven, self._session = proven, keyframe.session
        return self._tracks.go_on(keyframe, clock, self._recollection)

    def _register(
        self, candidates: Sequence[CandidateKeyframe], keyframe: Keyframe, track: CameraTrack, budget: Budget
    ) -> Found:
        """Register the keyframe with each candidate, and judge each pair by the gate and by what others say of it.

        Both in one pass: no more pairs are registered once enough are accepted.
        """
        return Search(keyframe, track.thinning, budget, self._means(track), self.params).run(candidates)

    def _means(self, track: CameraTrack) -> Means:
        gate, pool = self._gate or gate_of(self.params), self._pools.fitting()
        vetoes = self._recollection.vetoes
        return Means(self._store, self._method, gate, track.confirmation, pool, vetoes, track.rivalry)

    def _expect(self, keyframe: Keyframe, track: CameraTrack) -> None:
        """Compare what was known before it with a keyframe of the camera that is followed."""
        if track is self._tracks.followed:
            known = self._recollection.landmarks.placed(track.localisation.sessions(), EXPECTED)
            track.localisation.expect(keyframe, known)

    def _localise(self, keyframe: Keyframe, named: Sequence[Sighting], track: CameraTrack, budget: Budget) -> None:
        """Look for another place of the camera that is followed; that gives no constraints."""
        contrary = track.confirmation.take_contrary()
        if track is self._tracks.followed and keyframe.by_odometry:
            track.localisation.see(named)
            means, places = self._means(track), (self._recollection.index, track.hidden)
            weigh_contrary(track.localisation, keyframe, contrary, means.gate, self.params.least_odds)
            if self.params.kidnapping_search:
                search_elsewhere(track.localisation, keyframe, named, places, means, self.params, budget)

    def _none_alike(self, keyframe: Keyframe) -> Found:
        detail = f"none of {len(self._recollection.index)} stored objects is alike and may be here"
        return Found([], [], [rejected(keyframe.stamp_ns, keyframe, (Reason.NO_CANDIDATE, detail), keyframe)])

    def _remember(
        self,
        keyframe: Keyframe,
        sightings: Sequence[Sighting],
        believed: Sequence[Decision],
        found: Found,
        track: CameraTrack,
    ) -> tuple[tuple[LoopClosure, ...], tuple[Sighting, ...]]:
        """Store the keyframe with what is believed of it, and keep what waits; the closures, and its landmarks."""
        try:
            closures, named = self._recollection.remember(keyframe, sightings, believed)
        except StoreError:
            for decision in found.accepted:
                track.thinning.withdraw(decision.target.session, decision.target.stamp_ns, keyframe.stamp_ns)
            raise
        for decision, closure in zip(believed, closures, strict=True):
            track.add_closure(closure, keyframe, decision.target)
        if not track.proven:
            track.wait_for_proof(found.accepted, keyframe, named)
        for decision in found.waiting:
            track.hold(decision, keyframe, named)
        return closures, named

    def moment(self, keyframe_id: int) -> tuple[Keyframe, Clock]:
        """A stored keyframe, and the run of its camera's clock that goes on. KeyError where it is not stored, or no
        frame of its camera came since the start; StoreError where it is damaged.
        """
        with self._lock:
            keyframe = self._store.keyframe(keyframe_id)
            clock = self._tracks[keyframe.camera].clock
        if clock is None:
            raise KeyError(keyframe_id)
        return keyframe, clock

    @property
    def newest_keyframe(self) -> int:
        """The id of the keyframe that came last, 0 before the first."""
        with self._lock:
            return self._store.next_keyframe() - 1

    def take_session(self) -> int:
        """A number for a session of a keyframe that others store, which no session here has."""
        return self._numbers.next_number()

    def places(self, sightings: Sequence[Sighting], frame_id: str) -> list[CandidateKeyframe]:
        """What `compare` would try for a keyframe with these objects, the most promising first; may be empty.

        Places of its own robot are none, nor are those that an accepted closure ties to it already.
        """
        with self._lock:
            robot, stamp_ns = sightings[0].robot, sightings[0].stamp_ns
            found = self._recollection.index.query(sightings, self._recollection.index.sessions_of(robot))
            track = self._tracks.get((robot, frame_id))
            if track is None:
                return found
            return [one for one in found if not track.thinning.redundant(one.session, one.stamp_ns, stamp_ns)]

    def compare(
        self,
        keyframe: Keyframe,
        clock: Clock,
        candidates: Sequence[CandidateKeyframe],
        seconds: float = np.inf,
        hurried: Callable[[], bool] = lambda: False,
    ) -> Outcome:
        """`search` among ``candidates`` for a keyframe that others store: it has a session of `take_session`, and id 0.

        Its closures are remembered, it is not. The outcome has no keyframe.
        """
        budget = Budget(time.monotonic() + seconds, hurried)
        with self._lock:
            self.params = self._recollection.params = self._adopted
            track, stored = self._tracks.of(keyframe.camera), set(self._store.keyframe_ids())
            first, before = track.clock is None, self._tracks.go_on(keyframe, clock, self._recollection)
            if first:
                track.thinning.recall(self._recollection.ties_of(keyframe.camera))
            found = self._register([one for one in candidates if one.keyframe_id in stored], keyframe, track, budget)
            closures = self._recollection.remember_closures(keyframe, found.accepted)
            for decision in found.waiting:
                track.hold(decision, keyframe, self._recollection.as_known(keyframe, decision))
            outcome = Outcome(closures=closures, rejected=(*before, *found.refused), robot=keyframe.robot)
            return outcome.with_late(track.settle_waiting(keyframe.stamp_ns, self._recollection))

    @property
    def vetoed(self) -> tuple[LoopClosure, ...]:
        """The closures that a person withdrew, the oldest veto first."""
        with self._lock:
            return tuple(veto.closure for veto in self._recollection.vetoes)

    def veto(self, ids: Sequence[str], robot: str = "") -> Outcome:
        """Withdraw the stored closures of these ids (`closure_id`), all or none; they are not found again (`vetoes`).

        ``robot`` is that of closures that name none. What waited and says the same is refused. ValueError for an id
        of none; StoreError where it cannot be written. Objects that a closure made one stay one.
        """
        with self._lock:
            return self._withdrawn(self._recollection.veto(self._recollection.named(ids, robot, vetoed=False)))

    def undo_veto(self, ids: Sequence[str], robot: str = "") -> Outcome:
        """Let withdrawn closures hold again, all or none: the outcome has them. Errors as in `veto`."""
        with self._lock:
            closures = self._recollection.named(ids, robot, vetoed=True)
            self._recollection.undo_veto(closures)
            for closure in closures:
                ends = self._recollection.ends_of(closure)
                for track in self._tracks.all():
                    track.admit(closure, ends)
        return Outcome(closures=tuple(closures))

    def _withdrawn(self, vetoes: Sequence[Veto]) -> Outcome:
        closures = tuple(veto.closure for veto in vetoes)
        refused = [track.withdraw(closures, self._recollection.vetoes) for track in self._tracks.all()]
        return Outcome(withdrawn=closures, rejected=tuple(one for of in refused for one in of))

    def settle(self) -> Outcome:
        """Publish or refuse what still waits for other keyframes to confirm it: the end of a recording, or a save."""
        with self._lock:
            return in_turn([track.settle_waiting(None, self._recollection) for track in self._tracks.all()])

    def release(self, doubt: str = "") -> Outcome:
        """Publish what waits for proof of a camera that is silent; refuse it if that is in ``doubt``."""
        with self._lock:
            return in_turn([track.release(self._recollection, doubt) for track in self._tracks.all()])

    def reset(self) -> str:
        """Forget everything as `Store.clear` does, whose answer it is."""
        with self._lock:
            kept_at = self._store.clear()
            self._start(self._numbers.next)
        return kept_at

    def save(self, path: str = "") -> str:
        """Bring the store's file up to date, or write a copy of it to ``path``; returns where it is.
        StoreError where that cannot be, and without ``path`` where the store is a temporary one.
        """
        with self._lock:
            return self._store.save(path)

    def close(self) -> None:
        """Let go of the store."""
        with self._lock:
            self._pools.shutdown()
            self._store.close()
