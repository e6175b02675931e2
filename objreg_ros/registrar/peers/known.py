# SPDX-License-Identifier: Apache-2.0
"""The registrars that summaries come from, by the runs that name their starts.

A name proves nothing. So a number says little, a message is known by all of its bytes, and a newcomer takes the place
of none that gave what it was asked for.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass, field

from objreg_ros.data.closures import robot_of
from objreg_ros.registrar.summary import MOST_RUNS, Summary

MOST_JUMP = 10_000  # keyframes between two summaries of a peer: hours
MOST_SEEN = 4096  # summaries of a peer that are remembered
TRIAL_S = 60.0  # that a peer keeps its place before it gave a keyframe
IDLE_S = 600.0  # that one keeps its place in silence which gave some


@dataclass(slots=True)
class Peer:
    """One start of another registrar. ``proven``: a keyframe of its came, and was that of its summary."""

    robot: str
    since: float
    last: float
    newest: int = 0
    proven: bool = False
    seen: OrderedDict[bytes, None] = field(default_factory=OrderedDict)

    def may_go(self, now: float) -> bool:
        """Whether a newcomer may have its place."""
        return now - self.last > IDLE_S if self.proven else now - self.since > TRIAL_S


class Peers:
    """At most `MOST_RUNS` of them, beside our own ``robot``. Times are in s, of any clock that goes on."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._peers: dict[str, Peer] = {}

    def __contains__(self, run: object) -> bool:
        return run in self._peers

    @property
    def newest(self) -> dict[str, int]:
        """By run, the newest keyframe of which a summary came."""
        return {run: peer.newest for run, peer in self._peers.items()}

    def prove(self, run: str) -> None:
        """A keyframe of this run came that its summary announced."""
        if run in self._peers:
            self._peers[run].proven = True

    def refuse(self, summary: Summary, packed: bytes, now: float) -> str:
        """Why a summary is no news; empty where it is, and then it is known from now on."""
        run, number = summary.name
        if summary.robot == self._robot:
            return "a robot of our name"
        if robot_of(summary.frame_id, (self._robot, summary.robot)) != summary.robot:
            return "a frame of another robot"
        peer = self._peers.get(run)
        if peer is None:
            if not self._make_place(now):
                return "too many registrars"
            peer = self._peers[run] = Peer(summary.robot, now, now, number)
        elif peer.robot != summary.robot:
            return "a run of another robot"
        return self._refuse(peer, number, hashlib.blake2b(packed, digest_size=16).digest(), now)

    @staticmethod
    def _refuse(peer: Peer, number: int, digest: bytes, now: float) -> str:
        if number > peer.newest + MOST_JUMP:
            return "a far jump"
        if digest in peer.seen:
            return "received before"
        peer.last, peer.newest = now, max(peer.newest, number)
        peer.seen[digest] = None
        if len(peer.seen) > MOST_SEEN:
            peer.seen.popitem(last=False)
        return ""

    def _make_place(self, now: float) -> bool:
        if len(self._peers) < MOST_RUNS:
            return True
        leaving = [run for run, peer in self._peers.items() if peer.may_go(now)]
        if leaving:
            del self._peers[min(leaving, key=lambda run: self._peers[run].last)]
        return bool(leaving)
