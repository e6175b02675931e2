# SPDX-License-Identifier: Apache-2.0
"""What the registrar knows of one camera that goes on. Robots, and cameras of one robot, have one each."""

from __future__ import annotations

from collections.abc import Sequence

from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame
from objreg_ros.keyframes.frame_window import Clock, FrameWindow, SessionNumbers
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.registrar.closure import Decision, WaitingClosure, redundant, rejected, waiting_of
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.localisation.localisation import Localisation
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registrar.rivalry import Rivalry
from objreg_ros.registrar.thinning import Thinning
from objreg_ros.registrar.vetoes import VETOED, Vetoes
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.keyframe import Keyframe

UNPROVEN = Reason.CAMERA, "too little of the stream was seen to believe its camera"
MOST_CAMERAS = 64  # of all robots that are followed
GOES_ON_NS = 1_000_000_000  # a clock that is not so far ahead of one that begins goes on beside it

Camera = tuple[str, str]  # robot and frame_id


class CameraTrack:
    """Its frames become keyframes, by ``numbers`` of sessions that all share; what is likely waits for what comes next.

    ``thinning`` knows what was accepted in the run of the clock that goes on, ``hidden`` are the sessions whose stamps
    would name keyframes of that run.
    """

    def __init__(self, params: RegistrarParams, numbers: SessionNumbers) -> None:
        self._params = params
        self.keyframer = Keyframer(params, numbers)
        self.relocalisation = Relocalisation()
        self.localisation = Localisation(params, self.relocalisation)
        self.confirmation = Confirmation(params)
        self.thinning = Thinning(params.thin_seconds)
        self.rivalry = Rivalry(self.relocalisation)
        self.proven = True  # whether enough of the camera was seen to believe it
        self.unproven: list[WaitingClosure] = []  # accepted while it was not
        self.hidden: frozenset[int] = frozenset()
        self.clock: Clock | None = None
        self.sessions: set[int] = set()  # of the run of the clock
        self.newest_ns, self.newest_id = 0, 0

    def begin_run(self, clock: Clock, hidden: frozenset[int], params: RegistrarParams) -> None:
        """Another run of the clock goes on from now."""
        self.clock, self.hidden, self.sessions = clock, hidden, set()
        self.thinning = Thinning(params.thin_seconds)

    def see(self, keyframe: Keyframe) -> None:
        """Go on to a keyframe."""
        self.sessions.add(keyframe.session)
        self.newest_ns, self.newest_id = keyframe.stamp_ns, keyframe.keyframe_id

    def goes_on_beside(self, clock: Clock) -> bool:
        """Whether its run of the clock goes on, as another camera of the robot begins one."""
        return self.clock is not None and self.newest_ns < clock.began_ns + GOES_ON_NS

    def is_abreast(self, stamp_ns: int, keyframe_id: int) -> bool:
        """Whether it has come to about this time, by a keyframe that came after the one of this id."""
        return self.newest_id > keyframe_id and abs(self.newest_ns - stamp_ns) < GOES_ON_NS

    def give_up(self, refusal: Refusal | None = None) -> tuple[Rejected, ...]:
        """Refuse all that waits; for what it waits for where no other refusal is given."""
        unproven, self.unproven = [waiting.refused(refusal or waiting.refusal) for waiting in self.unproven], []
        return (*unproven, *self.confirmation.give_up(refusal))

    def withdraw(self, closures: Sequence[LoopClosure], vetoes: Vetoes) -> tuple[Rejected, ...]:
        """Take back what these closures brought, and refuse what waits and says the same."""
        for closure in closures:
            if closure.from_session is not None:
                self.thinning.withdraw(closure.from_session, closure.from_ns, closure.to_ns)
        self.relocalisation.withdraw(closures)
        self.localisation.withdraw(vetoes)
        gone = [waiting for waiting in self.unproven if vetoes.cover_waiting(waiting)]
        self.unproven = [waiting for waiting in self.unproven if waiting not in gone]
        return (*(waiting.refused(VETOED) for waiting in gone), *self.confirmation.withdraw(vetoes))

    def admit(self, closure: LoopClosure, ends: tuple[Keyframe, Keyframe] | None) -> None:
        """A closure holds again; ``ends`` are its keyframes, the later one first, None where one is not stored."""
        if closure.to_session in self.sessions and closure.from_session is not None:
            self.thinning.accept(closure.from_session, closure.from_ns, closure.to_ns)
        if ends is not None:
            self.relocalisation.add_closure(closure, *ends)
            self.localisation.admit(closure, *ends)

    def hold(self, decision: Decision, keyframe: Keyframe, named: Sequence[Sighting]) -> None:
        """Keep a pose that waits for other keyframes; ``named`` are the keyframe's sightings."""
        assert decision.refusal is not None and decision.waits_as is not None
        waiting = waiting_of(keyframe, named, decision, decision.refusal, self._params)
        self.confirmation.hold(decision.waits_as, waiting)

    def wait_for_proof(self, accepted: Sequence[Decision], keyframe: Keyframe, named: Sequence[Sighting]) -> None:
        """Keep what was accepted until the camera is believed; ``named`` are the keyframe's sightings."""
        params = self._params
        self.unproven += [waiting_of(keyframe, named, one, UNPROVEN, params) for one in accepted]

    def release(self, recollection: Recollection, doubt: str) -> Outcome:
        """Believe the camera, or refuse all that waits where it is in ``doubt``."""
        self.proven = not doubt
        return Outcome(rejected=self.give_up((Reason.CAMERA, doubt))) if doubt else self._released(recollection)

    def _released(self, recollection: Recollection) -> Outcome:
        waited, self.unproven = self.unproven, []
        return Outcome(closures=tuple(self._late(waiting, recollection) for waiting in waited))

    def settle_waiting(self, now_ns: int | None, recollection: Recollection) -> Outcome:
        """What waits no more: late constraints, which are written down, and refusals; all where there is no now.

        Nothing is published, and what is confirmed waits on, while the camera is not proven.
        """
        confirmed, refused = self.confirmation.decide_waiting(now_ns)
        closures = list(self._released(recollection).closures) if self.proven else []
        for waiting in confirmed:
            pair = waiting.from_session, waiting.closure.from_ns, waiting.closure.to_ns
            if self.thinning.redundant(*pair):
                refused.append(waiting.refused(redundant(recollection.params.thin_seconds)))
                continue
            self.thinning.accept(*pair)
            if self.proven:
                closures.append(self._late(waiting, recollection))
            else:
                self.unproven.append(waiting)
        return Outcome(closures=tuple(closures), rejected=tuple(refused))

    def _late(self, waiting: WaitingClosure, recollection: Recollection) -> LoopClosure:
        """A constraint that waited, written down."""
        settled, ends = recollection.remember_late(waiting)
        if ends is not None:
            self.add_closure(settled.closure, *ends)
        return settled.closure

    def add_closure(self, closure: LoopClosure, source: Keyframe, target: Keyframe) -> None:
        """Take in a closure of these keyframes, the later one first."""
        self.localisation.add_closure(closure, source, target)
        self.relocalisation.add_closure(closure, source, target)


class CameraTracks(dict[Camera, CameraTrack]):
    """One for each camera of each robot; of more than `MOST_CAMERAS` the oldest goes but for ``followed``.

    That is the one of the newest frame.
    """

    def __init__(self, params: RegistrarParams, numbers: SessionNumbers) -> None:
        super().__init__()
        self._params, self._numbers = params, numbers
        self.followed = CameraTrack(params, numbers)

    def all(self) -> tuple[CameraTrack, ...]:
        """Each of them, as they are now: a tracking thread may add one meanwhile."""
        return tuple(self.values())

    def of(self, camera: Camera) -> CameraTrack:
        """That of a camera, a new one where it has none."""
        if camera not in self:
            self[camera] = CameraTrack(self._params, self._numbers)
            while len(self) > MOST_CAMERAS:
                del self[next(oldest for oldest, track in tuple(self.items()) if track is not self.followed)]
        return self[camera]

    def track_of(self, frame: Frame) -> CameraTrack:
        """That of the camera of a frame, which is the newest."""
        self.followed = self.of((frame.robot, frame.frame_id))
        return self.followed

    def refuse(self, window: FrameWindow, doubt: str) -> Outcome:
        """Give up a frame window whose camera is in ``doubt``, and all that waits for that camera."""
        refusal = Reason.CAMERA, doubt
        return Outcome(rejected=(*self.of(window.camera).give_up(refusal), refused_window(window, refusal)))

    def finish_windows(self) -> list[FrameWindow]:
        """The frame windows that were being collected, without those that show nothing new."""
        ended = [track.keyframer.finish_window() for track in self.all()]
        return [window for window in ended if window is not None]

    def go_on(self, keyframe: Keyframe, clock: Clock, recollection: Recollection) -> tuple[Rejected, ...]:
        """Follow a camera to a keyframe; what is given up where its clock began anew.

        Then what an earlier run of the clock saw is left out, unless that was over by then: a stamp of it would name a
        keyframe of this run, and the session does not travel with a constraint.
        """
        track = self.of(keyframe.camera)
        given_up: tuple[Rejected, ...] = ()
        if clock != track.clock:
            hidden = self.hidden_from(clock, keyframe.camera, recollection.store)
            given_up = track.give_up() + clock_refusals(clock, hidden, keyframe)
            track.begin_run(clock, hidden, recollection.params)
        self._show_beside(track, keyframe)
        track.see(keyframe)
        return given_up

    def _show_beside(self, track: CameraTrack, keyframe: Keyframe) -> None:
        """Hide no more what cameras of the robot see whose keyframes come in turn with those of this one.

        Where a link was away, or this node, what it kept of one camera comes before what it kept of another.
        """
        for (robot, _), other in tuple(self.items()):
            if robot == keyframe.robot and other.is_abreast(keyframe.stamp_ns, track.newest_id):
                track.hidden, other.hidden = track.hidden - other.sessions, other.hidden - track.sessions

    def hidden_from(self, clock: Clock, camera: Camera, store: Store) -> frozenset[int]:
        """The sessions of a camera's robot that may have seen the time that the run of its clock goes through.

        What other cameras of the robot see in this very run is none of them, nor is what other robots see.
        """
        robot, _ = camera
        beside = (track for of, track in tuple(self.items()) if of[0] == robot and of != camera)
        together = set().union(*(track.sessions for track in beside if track.goes_on_beside(clock)))
        return store.sessions_beyond(robot, clock.session, clock.began_ns) - together


def refused_window(window: FrameWindow, refusal: Refusal) -> Rejected:
    """A frame window that was not compared with any other."""
    reason, detail = refusal
    first = window.frames[0]
    return Rejected(
        reason=reason,
        from_ns=first.stamp_ns,
        to_ns=first.stamp_ns,
        detail=detail,
        from_frame_id=first.frame_id,
        to_frame_id=first.frame_id,
        from_session=window.session,
        to_session=window.session,
        from_robot=first.robot,
        to_robot=first.robot,
    )


def clock_refusals(clock: Clock, hidden: frozenset[int], keyframe: Keyframe) -> tuple[Rejected, ...]:
    """What is reported where a run of the clock begins that leaves sessions out; nothing where it leaves none."""
    if not hidden:
        return ()
    why = f"sessions up to {max(hidden)} had seen that time before"
    refusal = Reason.CLOCK, f"the clock began anew at {1e-9 * clock.began_ns:.3f} s; {why}"
    return (rejected(keyframe.stamp_ns, keyframe, refusal, keyframe),)
