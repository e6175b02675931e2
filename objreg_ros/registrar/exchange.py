# SPDX-License-Identifier: Apache-2.0
"""Registrars that each keep a store of their own, and still close loops between their robots.

A registrar tells the others a summary of each keyframe. Who finds places of its own alike asks for the keyframe, and
compares it with those. Every pair of keyframes is looked at once: by the registrar that had its own when it heard of
the other; where both were told before either was heard, by that of the older one.

What is answered stays within bytes per second, the most promising first. Times are in s, of any clock that goes on.
All calls may come from any thread; those that need the registrar wait for a search that is under way.
"""

from __future__ import annotations

import threading
import uuid
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from objreg_ros.keyframes.frame_window import Clock
from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import StoreError
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.summary import (
    MOST_HEARD,
    Name,
    Request,
    Summary,
    pack_delivery,
    pack_request,
    pack_summary,
    unpack_delivery,
    unpack_request,
    unpack_summary,
)

BURST_S = 2.0  # of bytes that may be saved up
PATIENCE_S = 60.0  # that a request waits
MOST_WAITING = 1000  # requests
MOST_ASKED = 1000  # keyframes that are asked for, and did not come yet
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


class _Asked(NamedTuple):
    """A keyframe that was asked for, and what it is to be compared with."""

    summary: Summary
    candidates: Sequence[CandidateKeyframe]


class _Wish(NamedTuple):
    votes: float
    since: float


class Exchange:
    """What ``registrar`` says to those of other robots and hears of them; ``robot`` is the name of frames without one.

    ``books`` counts what was sent and heard, with its bytes, and what was dropped, by reason. ``run`` names this start.
    """

    def __init__(self, registrar: Registrar, robot: str, bytes_per_second: float = np.inf, run: str = "") -> None:
        self._registrar, self._robot, self.run = registrar, robot, run or uuid.uuid4().hex
        self._allowance, self._lock = Allowance(bytes_per_second), threading.Lock()
        self._from_before = self._told = registrar.newest_keyframe  # ids up to these
        self._heard = OrderedDict[str, int]()  # by run, the newest keyframe
        self._asked = OrderedDict[Name, _Asked]()
        self._wishes: dict[int, _Wish] = {}  # by keyframe
        self._sessions = OrderedDict[tuple[str, int], int]()  # by run and session there, the number here
        self.books: Counter[str] = Counter()

    @property
    def waiting(self) -> int:
        """How many requests are not answered yet."""
        return len(self._wishes)

    def announce(self, outcome: Outcome) -> bytes | None:
        """The summary of the keyframe that a search made, for all others.

        None where it made none, or keeps it not, or where that is too large to be told.
        """
        if outcome.keyframe_id is None:
            return None
        try:
            keyframe, clock = self._registrar.moment(outcome.keyframe_id)
        except (KeyError, StoreError):
            return None
        sightings = sightings_of(replace(keyframe, robot=keyframe.robot or self._robot))
        name = Name(self.run, keyframe.keyframe_id)
        with self._lock:
            self._told = name.keyframe_id
            summary = Summary(
                name=name, frame_id=keyframe.frame_id, clock=clock, sightings=sightings, heard=dict(self._heard)
            )
            try:
                return self._sent("summaries", pack_summary(summary))
            except ValueError:
                self.books["dropped: too large to be told"] += 1
                return None

    def hear(self, packed: bytes) -> bytes | None:
        """A request for the keyframe of a summary, where it may show a place that is stored here; else None.

        ValueError where the bytes are no summary.
        """
        summary = unpack_summary(packed)
        with self._lock:
            told = self._told
            if not self._is_news(summary, len(packed)):
                return None
            session = self._session_here(summary.name.run, summary.sightings[0].session)
        sightings = [replace(sighting, session=session) for sighting in summary.sightings]
        found = self._registrar.places(sightings, summary.frame_id)
        ours = [one for one in found if one.keyframe_id <= told and self._falls_to_us(one, summary)]
        with self._lock:
            if not ours:
                self.books["dropped: unlike"] += 1
                return None
            self._asked[summary.name] = _Asked(summary, ours)
            self._bound(self._asked, MOST_ASKED, "dropped: not answered")
            return self._sent("requests", pack_request(Request(summary.name, ours[0].votes)))

    def note(self, packed: bytes, now: float) -> None:
        """Let a request wait for `answer`: what several wish for promises more. ValueError where the bytes are none."""
        request = unpack_request(packed)
        if request.name.run != self.run:
            return
        number = request.name.keyframe_id
        with self._lock:
            self.books["requests heard"] += 1
            before = self._wishes.get(number, _Wish(0.0, now))
            self._wishes[number] = _Wish(before.votes + request.votes, before.since)
            if len(self._wishes) > MOST_WAITING:
                self._give_up(min(self._wishes, key=lambda n: self._wishes[n].votes), "crowded")

    def answer(self, now: float) -> bytes | None:
        """The keyframe that promises most of those that others wait for; None if none does, or it has to wait.

        Whoever asked for it takes it, so one answer is for all of them.
        """
        while (number := self._next(now)) is not None:
            try:
                packed = pack_delivery(self.run, self._registrar.moment(number)[0])
            except (KeyError, StoreError, ValueError):
                self.books["dropped: not to be had"] += 1
                continue
            with self._lock:
                return self._sent("keyframes", packed)
        return None

    def take(
        self, packed: bytes, seconds: float = np.inf, hurried: Callable[[], bool] = lambda: False
    ) -> Outcome | None:
        """What a keyframe that was asked for comes to, as `Registrar.search` has it; None for one that was not.

        ValueError where the bytes are no keyframe, or not the one of the summary.
        """
        name, came = unpack_delivery(packed)
        with self._lock:
            self.books["keyframes heard"] += 1
            self.books["bytes heard"] += len(packed)
            asked = self._asked.pop(name, None)
            if asked is None:
                self.books["dropped: not asked for"] += 1
                return None
            first, began = asked.summary.sightings[0], asked.summary.clock
            clock = Clock(began.began_ns, self._session_here(name.run, began.session))
            session = self._session_here(name.run, first.session)
        got, expected = (came.stamp_ns, came.session, came.frame_id), (first.stamp_ns, first.session)
        if got != (*expected, asked.summary.frame_id):
            raise ValueError(f"expected the keyframe at {expected[0]} ns of its summary, got one at {got[0]} ns")
        keyframe = replace(came, robot=first.robot, session=session)
        return self._named(self._registrar.compare(keyframe, clock, asked.candidates, seconds, hurried))

    def _is_news(self, summary: Summary, size: int) -> bool:
        run, number = summary.name
        if run == self.run:
            return False
        self.books["summaries heard"] += 1
        self.books["bytes heard"] += size
        if summary.robot == self._robot:
            self.books["dropped: a robot of our name"] += 1
        elif number <= self._heard.get(run, 0):
            self.books["dropped: heard before"] += 1
        else:
            self._heard[run] = number
            self._heard.move_to_end(run)
            self._bound(self._heard, MOST_HEARD)
            return True
        return False

    def _falls_to_us(self, stored: CandidateKeyframe, summary: Summary) -> bool:
        """Whether it is for us to look at a pair: the other had heard of ours, or ours is older."""
        known = max(self._from_before, summary.heard.get(self.run, 0))
        theirs = summary.sightings[0].stamp_ns, summary.name.run
        return stored.keyframe_id <= known or (stored.stamp_ns, self.run) < theirs

    def _session_here(self, run: str, session: int) -> int:
        if (run, session) not in self._sessions:
            self._sessions[run, session] = self._registrar.take_session()
            self._bound(self._sessions, MOST_SESSIONS)
        return self._sessions[run, session]

    def _next(self, now: float) -> int | None:
        """Take the most promising of those that wait, the older first; none while nothing may be sent."""
        with self._lock:
            for number in [n for n, wish in self._wishes.items() if now - wish.since > PATIENCE_S]:
                self._give_up(number, "waited too long")
            if not self._wishes or not self._allowance.some_left(now):
                return None
            number = max(self._wishes, key=lambda n: (self._wishes[n].votes, -n))
            del self._wishes[number]
            return number

    def _give_up(self, number: int, why: str) -> None:
        del self._wishes[number]
        self.books[f"dropped: {why}"] += 1

    def _bound(self, table: OrderedDict[Any, Any], most: int, why: str = "") -> None:
        while len(table) > most:
            table.popitem(last=False)
            if why:
                self.books[why] += 1

    def _sent(self, what: str, packed: bytes) -> bytes:
        self.books[f"{what} sent"] += 1
        self.books["bytes sent"] += len(packed)
        self._allowance.spend(len(packed))
        return packed

    def _named(self, outcome: Outcome) -> Outcome:
        """With our robot's name where frames have none."""
        closures = tuple(replace(one, from_robot=one.from_robot or self._robot) for one in outcome.closures)
        refused = tuple(replace(one, from_robot=one.from_robot or self._robot) for one in outcome.rejected)
        return replace(outcome, closures=closures, rejected=refused)
