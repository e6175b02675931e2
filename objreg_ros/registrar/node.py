# SPDX-License-Identifier: Apache-2.0
"""The node of the registrar: objects, views, gravity and odometry in; constraints, refusals and landmarks out.

Or the keyframes of robots in, which track by themselves (`keyframes/node.py`).
"""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, NamedTuple

from objreg_ros.bridge.messages import headers, known_objects_msg
from objreg_ros.bridge.messages.localisation_msg import summary_of
from objreg_ros.bridge.messages.markers import MarkerScene
from objreg_ros.bridge.node.node_base import DroppedError
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.robots import prefixes_of
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.node.worker import Backlog, Limit
from objreg_ros.bridge.process.intra_process import IntraProcessBus
from objreg_ros.bridge.streams.announcements import Announcements, LocalisationAnnouncements
from objreg_ros.bridge.streams.exchanging import Delivered, Exchanging
from objreg_ros.bridge.streams.frames_in import FramesNode
from objreg_ros.bridge.streams.key import read_key
from objreg_ros.bridge.streams.keyframes_in import FromRobot, KeyframesIn
from objreg_ros.bridge.streams.params import ExchangeParams, KeyParams, PeerParams, RelocalisedParams
from objreg_ros.bridge.streams.relocalised import Whereabouts
from objreg_ros.bridge.streams.sync import Match
from objreg_ros.data.closures import framed
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.registrar.diagnostics import RegistrarDiagnostics
from objreg_ros.registrar.exchange import Exchange
from objreg_ros.registrar.origins import arrival_of
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.registrar.registrar import Registrar

PATIENCE_S = 1.0  # a newer keyframe waits before the search in hand is cut short, if some were overtaken of late
WAITING_KEYFRAMES = 8  # most that wait for a search; no frame is followed while so many do
WAITING_BYTES = 200_000_000  # most memory of those
BEHIND = 64  # keyframes of a robot that may wait for their search: those of a link that was away come all at once
MOST_ASKING = 16  # callers of ~/where; each has a thread, and further ones are refused
GIVING_WAY = 10  # niceness of the search in a process of its own: the next image must not wait for it


class Job(NamedTuple):
    """A keyframe that waits for its search, made here or sent by a robot, and since when, by `time.monotonic`."""

    stamp_ns: int
    seen: FrameWindow | FromRobot | Delivered
    since: float


class RegistrarNode(FramesNode):
    """Follows every frame; searches, in a second worker, for the places that a keyframe shows again.

    A frame that completes a keyframe is acknowledged at once as followed, and is in the counters until its search is
    over. A keyframe that a newer one overtakes is stored without a search: nothing that was seen is lost. A search that
    newer ones wait for is cut short, and no frame is followed while too many wait.

    With ``robots`` it follows no frame: keyframes come from keyframers. Robots take turns, each with its oldest
    keyframe; `BEHIND` of them may wait before the oldest is stored without a search. With ``exchange`` it asks other
    registrars for keyframes that look alike, and compares them with its own.
    """

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        kinds = RegistrarParams, RegistrarNodeParams, ExchangeParams, KeyParams, PeerParams
        super().__init__("registrar", *kinds, RelocalisedParams, ManagedParams, bus=bus)

    def open(self) -> None:
        """Open the store, publish and listen."""
        inputs, self._key = self.settings.of(RegistrarNodeParams), read_key(self.settings.of(KeyParams).key_file)
        self._seconds = inputs.limit
        self._registrar = Registrar(self.settings.of(RegistrarParams))
        with ExitStack() as refused:  # a store that stays open could not be opened again
            refused.callback(self._registrar.close)
            self._open_to(inputs, refused)
            refused.pop_all()

    def _open_to(self, inputs: RegistrarNodeParams, refused: ExitStack) -> None:
        self._tracking, self._announcing = threading.Lock(), threading.Lock()
        self._unsearched, self._asking, self._scene = 0, 0, MarkerScene()
        self._shown_ns = 0  # of the newest keyframe
        self._may_reset = self.settings.of(PeerParams).allow_remote_reset
        self.when_silent(lambda doubt: self._publish(self._registrar.release(doubt)))
        self._counts = dict[str, Any](self._registrar.counts())
        self._robots = prefixes_of(self, list(inputs.cameras)) if inputs.robots else {}
        self._robot = self._asked_to_exchange()
        limit, nice = self._limit(), self._niceness()
        self.searcher: Backlog[Job] = Backlog(
            self._search, self._keep, self.fail, limit, lambda job: job.seen.nbytes, nice, lambda job: job.seen.robot
        )
        refused.callback(self.searcher.close)
        self._announcements = Announcements(self)
        self._announcements.retractions(self._registrar.vetoed)  # what was withdrawn while no node held the store
        self._whereabouts = Whereabouts(self, lambda: (self._registrar.relocalised, self._registrar.whereabouts))
        self._localisation = LocalisationAnnouncements(self, lambda: self._registrar.localisation)
        self.serve_aside("~/reset", self._forget)
        self.serve_aside("~/save", self._settle_and_save)
        self.serve_vetoes(self._veto)
        self.serve_enable("frames")
        if known_objects_msg.Where is not None:
            self.create_service(known_objects_msg.Where, "~/where", self._where, callback_group=self.apart)
        if self._robot:
            asked = self.settings.of(ExchangeParams)
            self._exchange = Exchange(self._registrar, self._robot, 1000.0 * asked.exchange_kilobytes)
            self._others = Exchanging(self, asked.exchange, self._exchange, self._take, self._key)
        if self._robots:
            self._keyframes = KeyframesIn(self, self._robots, [*inputs.cameras.values()], self._take, self._key)
        else:
            self.listen_to_frames(inputs.mounting, inputs.odom_slop)

    def _asked_to_exchange(self) -> str:
        """Our own robot's name if keyframes are exchanged; empty if not. ValueError where it has none."""
        robot, topics = self.get_namespace().strip("/"), self.settings.of(ExchangeParams).exchange
        if topics and (self._robots or not robot):
            got = "robots" if self._robots else "none"
            raise ValueError(f"exchange: expected a namespace, which names one robot, got {got}; add -r __ns:=/NAME")
        return robot if topics else ""

    def _limit(self) -> Limit:
        """How many keyframes may wait for their search. A robot that is behind cuts no other one's search short."""
        lanes = [*self._robots, *([""] if self._robot else [])]
        jobs, patience_s = max(WAITING_KEYFRAMES, 2 * BEHIND * len(lanes)), math.inf if self._robots else PATIENCE_S
        return Limit(jobs, WAITING_BYTES, patience_s, dict.fromkeys(lanes, BEHIND))

    def apply_parameters(self) -> None:
        """Live parameters hold from the next frame and the next search on."""
        self._registrar.use_parameters(self.settings.of(RegistrarParams))
        self._seconds = self.settings.of(RegistrarNodeParams).limit

    def _niceness(self) -> int:
        """The niceness of the search: `GIVING_WAY`, but 0 where the segmenter runs in this process.

        Both share Python's lock there. A nice thread that waits for a processor with the lock held stops both.
        """
        return 0 if self.receives_values else GIVING_WAY

    # Compute

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        """Follow one frame; a keyframe goes on to the searcher."""
        if not self.is_enabled:
            raise DroppedError("disabled", "")
        frame, T_body_camera = self.frame_of(payload)
        if self._robot:
            frame = replace(frame, robot=self._robot, frame_id=framed(self._robot, frame.frame_id))
        self._scene.see(frame)
        with self._tracking:  # until it waits: none that a service ends comes before it
            with self.accounting.timed("track"):
                window = self._registrar.track(frame)
            if window is not None:
                self.hand_on(stamp_ns)
                self.searcher.put(Job(stamp_ns, window, time.monotonic()))
        self._whereabouts.mounted(T_body_camera)
        self._whereabouts.look()
        self._localisation.passed(stamp_ns, frame.frame_id)
        return window is None

    def _take(self, seen: FromRobot | Delivered) -> None:
        """A keyframe of a robot that is in the counters goes on to the searcher."""
        if self.is_enabled:
            self.searcher.put(Job(seen.stamp_ns, seen, time.monotonic()))
        else:
            self.drop(seen.stamp_ns, "disabled")

    def _search(self, job: Job) -> None:
        self.conclude(job.stamp_ns, lambda: self._find(job, "search", self._seconds))

    def _keep(self, job: Job) -> None:
        """Store a keyframe without a search: a newer one waits."""
        self._unsearched += 1
        self.throttled.warn("unsearched", "a keyframe was stored without a search: a newer one came before its turn")
        self.conclude(job.stamp_ns, lambda: self._find(job, "keep", 0.0))

    def _find(self, job: Job, stage: str, seconds: float) -> bool:
        self.accounting.spend("wait", time.monotonic() - job.since)
        with self.accounting.timed(stage):
            outcome = self._outcome(job.seen, seconds)
        if outcome is None:
            self.leave_out(job.stamp_ns, "known")
            return False
        if isinstance(job.seen, FromRobot):
            self._keyframes.count(job.seen.robot, "searched" if seconds else "stored unsearched")
        self._publish(outcome)
        return True

    def _outcome(self, seen: FrameWindow | FromRobot | Delivered, seconds: float) -> Outcome | None:
        """What becomes of a keyframe; None for one of another robot that is known, or was not asked for."""
        hurried = self.searcher.hurried
        if isinstance(seen, FromRobot):
            arrival = self.read("keyframes", arrival_of, seen.robot, seen.sent)
            return self._registrar.receive_keyframe(arrival, seconds, hurried)
        if isinstance(seen, Delivered):
            return self._exchange.receive_delivery(seen.packed, seconds, hurried)
        outcome = self._registrar.search(seen, seconds, hurried)
        if self._robot and outcome.keyframe_ns is not None:
            self._others.send(outcome.keyframe_ns, self._exchange.announce(outcome))
        return outcome

    def _publish(self, outcome: Outcome) -> None:
        with self._announcing:  # the searcher's thread and that of ~/save
            self._announcements.closures(outcome.closures)
            self._announcements.retractions(outcome.withdrawn)
            self._announcements.refusals(outcome.rejected)
            self._count()
            self._whereabouts.look()
            self._localisation.look()
            if outcome.keyframe_ns is not None:
                seen = outcome.observations, outcome.keyframe_ns, outcome.frame_id
                self._announcements.landmarks(*seen, self.names_of(outcome.robot), outcome.session, outcome.robot)
                self._scene.show_keyframe(outcome.keyframe_ns)
                self._shown_ns = outcome.keyframe_ns
            self._show(outcome)

    def _show(self, outcome: Outcome) -> None:
        """Publish the markers again where something of them changed."""
        joined = self._scene.join(outcome.closures, outcome.rejected)
        parted = self._scene.part(outcome.withdrawn)
        if outcome.keyframe_ns is not None or joined or parted:
            objects = [(known.landmark, known.label, known.position) for known in self._registrar.landmarks_here]
            self._announcements.markers(self._scene.markers(objects, self._shown_ns, self.odom_frame))

    def _count(self) -> None:
        """Count what is stored, and say so where the oldest had to go."""
        forgotten, self._counts = self._counts["forgotten"], dict(self._registrar.counts())
        if self._counts["forgotten"] != forgotten:
            self.throttled.warn(
                "forgotten",
                f"the store is full: it keeps {self._counts['keyframes']} keyframes (max_keyframes, max_megabytes), "
                f"and has forgotten the oldest {self._counts['forgotten']}; places that only they show are not "
                "recognised any more",
            )

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What is stored and what waits, and what was announced of closures."""
        own = RegistrarDiagnostics(
            **self._counts,
            unsearched=self._unsearched,
            waiting_keyframes=len(self.searcher),
            waiting_poses=self._registrar.waiting,
            without_odometry=self.without_odometry,
            localisation=summary_of(self._localisation.now),
            robots=self._keyframes.counts if self._robots else {},
            exchange=self._exchange.counters if self._robot else {},
            **self._announcements.counts(),
        )
        return (*super().own_diagnostics(), own)

    # Services

    def _forget(self) -> tuple[bool, str]:
        """Whether everything is forgotten; why not, if the store or a parameter does not let it, and nothing is.

        Once the search in hand is over; the keyframes that wait for theirs are dropped.
        """
        if self.settings.of(RegistrarParams).store and not self._may_reset:
            return False, "expected allow_remote_reset:=true for a store in a file, got false; set it at the start"
        with self._tracking:
            waiting = self.searcher.rest()
            self.searcher.drain()  # what is in hand may still be unpacked, and would be stored after the reset
            try:
                aside = self._registrar.reset()
                self._counts = dict(self._registrar.counts())
            except OSError as error:
                self.searcher.give_back(waiting)
                return False, str(error)
        for job in waiting:
            self.drop(job.stamp_ns, "reset")
        with self._announcing:
            self._scene.clear()
        self._whereabouts.look()
        return True, "forgot every keyframe" + (f"; what was stored is in {aside}" if aside else "")

    async def _where(self, request: Any, response: Any) -> Any:
        """`Registrar.where`, once the search in hand is over."""
        if self._asking >= MOST_ASKING:
            response.message = f"~/where: call again: {MOST_ASKING} earlier calls are not done yet"
            return response
        self._asking += 1
        try:
            label = headers.bounded(request.label, "label")
            found = await self.aside(lambda: self._registrar.where(label))
        except (ValueError, OSError) as error:
            response.message = str(error)
            return response
        finally:
            self._asking -= 1
        robot = self._robot or self.get_namespace().strip("/")
        return known_objects_msg.fill(response, found, self.odom_frame, robot)

    def _settle_and_save(self) -> tuple[bool, str]:
        """Whether it could be, and where it is or what was in the way. The last keyframe comes after all others.

        It ends the keyframe in hand. With odometry the session goes on; without, our own tracking begins another.
        """
        try:
            with self._tracking:
                self.searcher.drain()
                for window in self._registrar.end_windows():
                    self._publish(self._outcome(window, self._seconds) or Outcome())
                self._publish(self._registrar.settle())
            return True, self._registrar.save()
        except (ValueError, OSError) as error:
            return False, str(error)

    def _veto(self, ids: Sequence[str], undo: bool) -> tuple[bool, str]:
        """Whether the closures are withdrawn, or hold again; why not, and then nothing has changed."""
        change, robot = self._registrar.undo_veto if undo else self._registrar.veto, self.get_namespace().strip("/")
        try:
            outcome = change(ids, robot)
        except (ValueError, OSError) as error:
            return False, str(error)
        self._publish(outcome)
        done = f"brought back {len(outcome.closures)}" if undo else f"withdrew {len(outcome.withdrawn)}"
        return True, f"{done} constraints"

    def shut(self) -> None:
        """End both workers, the search in hand early, store what they had not come to, let go of the store."""
        self.searcher.shut()
        self.end_aside()
        self.end_work()
        self.searcher.close()
        if self._robot:
            self._others.close()
        with ExitStack() as ends:
            ends.callback(self._registrar.close)
            self._store_the_rest()

    def _store_the_rest(self) -> None:
        """Store the keyframes that were not searched for; of those that cannot be the log says how many and why."""
        lost = list[str]()
        for seen in (*(job.seen for job in self.searcher.rest()), *self._registrar.end_windows()):
            try:
                self._outcome(seen, 0.0)
            except Exception as error:  # whatever is wrong with one, the others are stored
                lost.append(f"{type(error).__name__}: {error}")
        if lost:
            self.get_logger().error(f"the last keyframes could not be stored, {len(lost)} are lost: {lost[-1]}")


def main() -> int:
    """The executable ``registrar``."""
    return run(RegistrarNode)


if __name__ == "__main__":
    sys.exit(main())
