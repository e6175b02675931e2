# SPDX-License-Identifier: Apache-2.0
"""Registrars that each keep a store of their own, and still close loops between their robots.

A registrar sends the others a summary of each keyframe. One that has similar places asks for the keyframe, and
compares it with those. Every pair of keyframes is looked at once: by the registrar that had its own when it received
the other; where both were sent before either was received, by that of the older one.

What is answered stays within bytes per second: askers take turns, each with the most promising. Names are believed of
nobody: `peers/` says what a false one cannot do. Times are in s, of any clock that goes on.
All calls may come from any thread; those that need the registrar wait for a search that is under way.
"""

from __future__ import annotations

import threading
import uuid
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from objreg_ros.data.closures import framed
from objreg_ros.keyframes.frame_window import Clock
from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import StoreError
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.peers.known import Peers
from objreg_ros.registrar.peers.pending import KeyframeRequest, Pending
from objreg_ros.registrar.peers.wishes import Wishes
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.summary import (
    Name,
    Request,
    Summary,
    name_of,
    pack_delivery,
    pack_request,
    pack_summary,
    unpack_delivery,
    unpack_request,
    unpack_summary,
)
from objreg_ros.registration.keyframe import Keyframe

BURST_S = 2.0  # of bytes that may be saved up
MOST_SESSIONS = 4096  # of other registrars that have a number here


class Allowance:
    """Bytes that may be sent: so many a second, which add up to those of `BURST_S`. Debts are made up for."""

    def __init__(self, bytes_per_second: float) -> None:
        self._rate, self._then = bytes_per_second, -np.inf
        self._left = self._most = BURST_S * bytes_per_second

    def some_left(self, now: float) -> bool:
        """Whether anything may be sent now."""
        if now > self._then:
            self._left = min(self._left + self._rate * (now - self._then), self._most)
            self._then = now
        return self._left > 0

    def spend(self, sent: int) -> None:
        """So many bytes were sent."""
        self._left -= sent


class Exchange:
    """What ``registrar`` says to those of other robots and receives them; ``robot`` is the name of frames without one.

    ``counters`` counts what was sent and received, with its bytes, and what was dropped, by reason. ``run`` names this
    start.
    """

    def __init__(self, registrar: Registrar, robot: str, bytes_per_second: float = np.inf, run: str = "") -> None:
        self._registrar, self._robot, self.run = registrar, robot, run or uuid.uuid4().hex
        self._allowance, self._lock = Allowance(bytes_per_second), threading.Lock()
        self._from_before = self._announced = registrar.newest_keyframe  # ids up to these
        self._sessions = OrderedDict[tuple[str, int], int]()  # by run and session there, the number here
        self.counters: Counter[str] = Counter()
        self._peers, self._pending, self._wishes = Peers(robot), Pending(self.counters), Wishes(self.counters)

    @property
    def waiting(self) -> int:
        """How many keyframes others wait for."""
        return len(self._wishes)

    def announce(self, outcome: Outcome) -> bytes | None:
        """The summary of the keyframe that a search made, for all others.

        None where it made none, or keeps it not, or where that is too large to be sent.
        """
        if outcome.keyframe_id is None:
            return None
        try:
            keyframe, clock = self._registrar.moment(outcome.keyframe_id)
        except (KeyError, StoreError):
            return None
        named = self._ours(keyframe)
        sightings = sightings_of(named)
        name = Name(self.run, keyframe.keyframe_id)
        with self._lock:
            self._announced = name.keyframe_id
            summary = Summary(
                name=name, frame_id=named.frame_id, clock=clock, sightings=sightings, received=self._peers.newest
            )
            try:
                return self._sent("summaries", pack_summary(summary))
            except ValueError:
                self.counters["dropped: too large to announce"] += 1
                return None

    def sender(self, packed: bytes) -> str:
        """The run of the registrar that a summary names, empty for one that is not known yet; ValueError for none."""
        run = name_of(packed).run
        return run if run in self._peers else ""

    def receive_summary(self, packed: bytes, now: float = 0.0) -> bytes | None:
        """A request for the keyframe of a summary, where it may show a place that is stored here; else None.

        ValueError where the bytes are no summary.
        """
        summary = unpack_summary(packed)
        with self._lock:
            announced = self._announced
            if not self._is_news(summary, packed, now):
                return None
            session = self._session_here(summary.name.run, summary.sightings[0].session)
        sightings = [replace(sighting, session=session) for sighting in summary.sightings]
        found = self._registrar.places(sightings, summary.frame_id)
        ours = [one for one in found if one.keyframe_id <= announced and self._falls_to_us(one, summary)]
        with self._lock:
            if not ours:
                self.counters["dropped: unlike"] += 1
                return None
            if not self._pending.add_request(KeyframeRequest(summary, ours, now)):
                return None
            return self._sent("requests", pack_request(Request(summary.name, ours[0].votes, self.run)))

    def note(self, packed: bytes, now: float) -> None:
        """Let a request wait for `answer`: what several wish for promises more. ValueError where the bytes are none.

        Those who sent no summary yet are one asker together.
        """
        request = unpack_request(packed)
        if request.name.run != self.run:
            return
        with self._lock:
            self.counters["requests received"] += 1
            asker = request.asker if request.asker in self._peers else ""
            self._wishes.add_wish(asker, request.name.keyframe_id, request.votes, now)

    def answer(self, now: float) -> bytes | None:
        """The keyframe that promises most of those that one asker waits for; None if none does, or it has to wait.

        Askers take turns. Whoever asked for it takes it, so one answer is for all of them.
        """
        while (number := self._next(now)) is not None:
            try:
                packed = pack_delivery(self.run, self._ours(self._registrar.moment(number)[0]))
            except (KeyError, StoreError, ValueError):
                self.counters["dropped: not to be had"] += 1
                continue
            with self._lock:
                return self._sent("keyframes", packed)
        return None

    def awaits(self, packed: bytes) -> bool:
        """Whether a keyframe was asked for, by the name that it has; ValueError where it has none."""
        name = name_of(packed)
        with self._lock:
            return name in self._pending

    def receive_delivery(
        self, packed: bytes, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome | None:
        """What a keyframe that was asked for comes to, as `Registrar.search` has it; None for one that was not.

        ValueError where the bytes are no keyframe, or not the one of the summary: that one is still waited for.
        """
        name, came = unpack_delivery(packed)
        with self._lock:
            self.counters["keyframes received"] += 1
            self.counters["bytes received"] += len(packed)
            if name not in self._pending:
                self.counters["dropped: not asked for"] += 1
                return None
        asked = self._answered(name, came)
        first, began = asked.summary.sightings[0], asked.summary.clock
        with self._lock:
            self._pending.remove_request(asked)
            self._peers.prove(name.run)
            clock = Clock(began.began_ns, self._session_here(name.run, began.session))
            session = self._session_here(name.run, first.session)
        keyframe = replace(came, robot=first.robot, session=session, frame_id=asked.summary.frame_id)
        return self._named(self._registrar.compare(keyframe, clock, asked.candidates, seconds, hurried))

    def _answered(self, name: Name, came: Keyframe) -> KeyframeRequest:
        """What a keyframe is the answer to; ValueError where it is not that of a summary."""
        with self._lock:
            asked = self._pending.find(name, came.stamp_ns, came.session, came.frame_id)
        refused = ValueError(
            f"expected the keyframe of its summary, got one at {came.stamp_ns} ns of {came.frame_id!r}"
        )
        seen = sightings_of(came)
        for one in asked:
            try:
                one.require(seen)
            except ValueError as error:
                refused = error
            else:
                return one
        raise refused

    def _is_news(self, summary: Summary, packed: bytes, now: float) -> bool:
        if summary.name.run == self.run:
            return False
        self.counters["summaries received"] += 1
        self.counters["bytes received"] += len(packed)
        if why := self._peers.refuse(summary, packed, now):
            self.counters[f"dropped: {why}"] += 1
        return not why

    def _falls_to_us(self, stored: CandidateKeyframe, summary: Summary) -> bool:
        """Whether it is for us to look at a pair: the other knew of ours, or ours is older."""
        known = max(self._from_before, summary.received.get(self.run, 0))
        theirs = summary.sightings[0].stamp_ns, summary.name.run
        return stored.keyframe_id <= known or (stored.stamp_ns, self.run) < theirs

    def _session_here(self, run: str, session: int) -> int:
        if (run, session) not in self._sessions:
            self._sessions[run, session] = self._registrar.take_session()
            if len(self._sessions) > MOST_SESSIONS:  # the oldest of the run that has most goes
                fullest = Counter(of for of, _ in self._sessions).most_common(1)[0][0]
                del self._sessions[next(one for one in self._sessions if one[0] == fullest)]
        return self._sessions[run, session]

    def _next(self, now: float) -> int | None:
        """Take the next of those that wait; none while nothing may be sent."""
        with self._lock:
            self._wishes.expire(now)
            return self._wishes.next_wish(now) if self._allowance.some_left(now) else None

    def _ours(self, keyframe: Keyframe) -> Keyframe:
        """A stored keyframe as others get it, under the name of our robot."""
        robot = keyframe.robot or self._robot
        return replace(keyframe, robot=robot, frame_id=framed(robot, keyframe.frame_id))

    def _sent(self, what: str, packed: bytes) -> bytes:
        self.counters[f"{what} sent"] += 1
        self.counters["bytes sent"] += len(packed)
        self._allowance.spend(len(packed))
        return packed

    def _named(self, outcome: Outcome) -> Outcome:
        """With our robot's name where frames have none."""
        closures = tuple(replace(one, from_robot=one.from_robot or self._robot) for one in outcome.closures)
        refused = tuple(replace(one, from_robot=one.from_robot or self._robot) for one in outcome.rejected)
        return replace(outcome, closures=closures, rejected=refused)
