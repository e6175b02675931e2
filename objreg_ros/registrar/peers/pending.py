# SPDX-License-Identifier: Apache-2.0
"""The keyframes that we asked of others, shared fairly by the runs that announced them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registrar.summary import Name, Summary

MOST_ASKED = 1000  # keyframes that did not come yet
ASKED_S = 600.0  # that we wait for one
APART_M = 0.2  # between an object of a summary and of its keyframe, which has fewer points of it

Moment = tuple[Name, int, int, str]  # of a keyframe: name, stamp, session and camera


class KeyframeRequest(NamedTuple):
    """A keyframe that we asked for, and what it is to be compared with."""

    summary: Summary
    candidates: Sequence[CandidateKeyframe]
    since: float

    @property
    def key(self) -> tuple[Moment, bytes]:
        """What the answer has to have: its keyframe, and the labels and positions of its objects."""
        first, seen = self.summary.sightings[0], self.summary.sightings
        moment = self.summary.name, first.stamp_ns, first.session, self.summary.frame_id
        return moment, repr([(one.label, one.position.tolist()) for one in seen]).encode()

    def require(self, seen: Sequence[Sighting]) -> None:
        """ValueError unless the objects of an answer stand where the summary has some of their label."""
        for one in seen:
            known = [s.position for s in self.summary.sightings if s.label == one.label]
            if min((float(np.abs(at - one.position).max()) for at in known), default=np.inf) > APART_M:
                raise ValueError(f"expected the objects of its summary, got {one.label[:40]!r} at {one.position}")


class Pending:
    """The keyframes that we asked for. What waits is pushed out by none but its own run; not for two threads."""

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self._asked: dict[tuple[Moment, bytes], KeyframeRequest] = {}  # by keyframe and objects, the oldest first

    def __contains__(self, name: object) -> bool:
        return any(moment[0] == name for moment, _ in self._asked)

    def add_request(self, asked: KeyframeRequest) -> bool:
        """Whether it may wait: of too many the newest of the run that has most does not."""
        for key in [k for k, one in self._asked.items() if asked.since - one.since > ASKED_S]:
            self._drop(key)
        if len(self._asked) >= MOST_ASKED:
            counts = Counter(moment[0].run for moment, _ in self._asked)
            fullest, most = counts.most_common(1)[0]
            if counts[asked.summary.name.run] + 1 >= most:
                self._counters["dropped: too many asked for"] += 1
                return False
            self._drop(next(key for key in reversed(self._asked) if key[0][0].run == fullest))
        self._asked[asked.key] = asked
        return True

    def find(self, name: Name, stamp_ns: int, session: int, frame_id: str) -> list[KeyframeRequest]:
        """What an answer may be the answer to: several where summaries of one name differ, as a forged one does."""
        wanted = name, stamp_ns, session, frame_id
        return [asked for (moment, _), asked in self._asked.items() if moment == wanted]

    def remove_request(self, asked: KeyframeRequest) -> None:
        """Its answer came, and was the right one."""
        self._asked.pop(asked.key, None)

    def _drop(self, key: tuple[Moment, bytes]) -> None:
        del self._asked[key]
        self._counters["dropped: not answered"] += 1
