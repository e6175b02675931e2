# SPDX-License-Identifier: Apache-2.0
"""The counters of a node: where every input frame is, and how long it took. Knows no ROS.

Every frame that is received ends as published or as dropped with a reason, exactly once, and waits until then:
received = published + waiting + dropped, at all times. ``total`` is from arrival until a frame's own work is done, and
``keyframe`` from there until the keyframe that it completed is done too.

The stages of a frame are summed up by frame, and count with its ``total``: of those that went out, so that no stage
takes longer than the total that it is part of. So are the stages of a keyframe, as part of ``keyframe``.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

RECENT = 1000  # how many frames, keyframes and durations of a stage the percentiles look back on
TOTAL, KEYFRAME = "total", "keyframe"

Spent = dict[str, float]  # stage → seconds, of one frame


@dataclass(frozen=True)
class Balance:
    """The state of the counters at one time."""

    received: int
    published: int
    waiting: int
    dropped: dict[str, int]
    lost: dict[str, int]  # topic → messages that were sent and never reached us
    stage_ms: dict[str, tuple[float, float]] = field(default_factory=dict)  # stage → (p50, p95)


class Accounting:
    """Counts frames by their stamps; safe to use from the executor and the worker at once."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._arrived: defaultdict[int, list[float]] = defaultdict(list)
        self._handed_on: defaultdict[int, list[float]] = defaultdict(list)  # when, of those that wait
        self._received = self._published = 0
        self._dropped: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._frames, self._keyframes = deque[Spent](maxlen=RECENT), deque[Spent](maxlen=RECENT)
        self._aside: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=RECENT))  # of no frame
        self._here = _Here()

    def count_frame(self, stamp_ns: int) -> None:
        """A frame came in."""
        with self._lock:
            self._received += 1
            self._arrived[stamp_ns].append(time.perf_counter())

    def hand_on(self, stamp_ns: int) -> None:
        """The own work of a waiting frame is done, its keyframe's is not; KeyError if none of this stamp waits."""
        with self._lock:
            now, arrived = time.perf_counter(), self._arrived.get(stamp_ns)
            if not arrived:
                raise KeyError(f"no frame of {stamp_ns} ns waits")
            self._frames.append({**self._here.take(), TOTAL: now - arrived[0]})
            self._handed_on[stamp_ns].append(now)

    def publish(self, stamp_ns: int) -> None:
        """A waiting frame went out; KeyError if none of this stamp waits."""
        with self._lock:
            arrived, handed_on = self._settle(stamp_ns)
            now, spent = time.perf_counter(), self._here.take()
            if handed_on is None:
                self._frames.append({**spent, TOTAL: now - arrived})
            else:
                self._keyframes.append({**spent, KEYFRAME: now - handed_on})
            self._published += 1

    def drop(self, stamp_ns: int, reason: str) -> None:
        """A waiting frame will not go out; KeyError if none of this stamp waits."""
        with self._lock:
            self._settle(stamp_ns)
            self._dropped[reason] += 1

    def lose(self, topic: str, count: int) -> None:
        """The transport lost messages of a topic."""
        with self._lock:
            self._lost[topic] += count

    @contextmanager
    def working(self) -> Iterator[None]:
        """What this thread measures within is of the frame that it hands on or publishes next, while within."""
        if self._here.spent is not None:  # the last work on another frame ends within that on this one
            yield
            return
        self._here.spent = {}
        try:
            yield
        finally:
            self._here.spent = None

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Measure a stage. What is measured within it is part of it, and does not count by itself."""
        if self._here.is_timed:
            yield
            return
        self._here.is_timed, start = True, time.perf_counter()
        try:
            yield
        finally:
            self._here.is_timed = False
        self.spend(stage, time.perf_counter() - start)

    def spend(self, stage: str, seconds: float) -> None:
        """Record the duration of a stage."""
        spent = self._here.spent
        if spent is not None:
            spent[stage] = spent.get(stage, 0.0) + seconds
            return
        with self._lock:
            self._aside[stage].append(seconds)

    def balance(self) -> Balance:
        """The counters now."""
        with self._lock:
            waiting = sum(map(len, self._arrived.values()))
            stages = {**self._aside, **by_stage(self._keyframes), **by_stage(self._frames)}
            stage_ms = {stage: percentiles_ms(seconds) for stage, seconds in stages.items()}
            return Balance(
                received=self._received,
                published=self._published,
                waiting=waiting,
                dropped=dict(self._dropped),
                lost=dict(self._lost),
                stage_ms=stage_ms,
            )

    def _settle(self, stamp_ns: int) -> tuple[float, float | None]:
        """When the first frame of a stamp that waits arrived, and was handed on if it was."""
        arrived = _pop(self._arrived, stamp_ns)
        if arrived is None:
            raise KeyError(f"no frame of {stamp_ns} ns waits")
        return arrived, _pop(self._handed_on, stamp_ns)


class _Here(threading.local):
    """What a thread has spent on the frame in its hands, by stage; None while it has none."""

    spent: Spent | None = None
    is_timed = False

    def take(self) -> Spent:
        """What was spent so far; what follows is of the next frame."""
        spent, self.spent = self.spent or {}, None if self.spent is None else {}
        return spent


def by_stage(frames: Iterable[Spent]) -> dict[str, list[float]]:
    """The seconds of each stage, 0 for a frame that did without it: as many for each stage as there are frames."""
    known = list(frames)
    stages = dict.fromkeys(stage for spent in known for stage in spent)
    return {stage: [spent.get(stage, 0.0) for spent in known] for stage in stages}


def _pop(times: dict[int, list[float]], stamp_ns: int) -> float | None:
    """Take the first time of a stamp out; None if there is none."""
    if not (kept := times.get(stamp_ns)):
        return None
    first = kept.pop(0)
    if not kept:
        del times[stamp_ns]
    return first


def percentiles_ms(seconds: Iterable[float]) -> tuple[float, float]:
    """The median and the 95th percentile in milliseconds."""
    p50, p95 = np.percentile(np.fromiter(seconds, float), (50, 95)) * 1e3
    return float(p50), float(p95)
