# SPDX-License-Identifier: Apache-2.0
"""One thread for the work of a node, so that its subscriptions never wait for it. Knows no ROS."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from types import MappingProxyType
from typing import Generic, NamedTuple, TypeVar

Job = TypeVar("Job")

PRESSED_S = 30.0  # for so long after a job was overtaken the next ones run without niceness


class Worker(Generic[Job]):
    """Runs ``work`` on the newest job. A job that a newer one overtakes goes to ``replaced`` instead.

    What ``work`` raises ends the worker and goes to ``failed``: a bug is not to be survived in silence.
    """

    def __init__(
        self,
        work: Callable[[Job], None],
        replaced: Callable[[Job], None],
        failed: Callable[[BaseException], None],
    ) -> None:
        self._work, self._replaced, self._failed = work, replaced, failed
        self._ready = threading.Condition()
        self._next: Job | None = None
        self._open = True
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self._thread.start()

    def put(self, job: Job) -> None:
        """Hand over a job; never waits."""
        with self._ready:
            overtaken, self._next = self._next, job
            self._ready.notify()
        if overtaken is not None:
            self._replaced(overtaken)

    def close(self) -> None:
        """Finish the job in hand, leave the one that waits, end the thread."""
        with self._ready:
            self._open = False
            self._ready.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _take(self) -> Job | None:
        with self._ready:
            self._ready.wait_for(lambda: self._next is not None or not self._open)
            job, self._next = self._next, None
            return job if self._open else None

    def _run(self) -> None:
        try:
            while (job := self._take()) is not None:
                self._work(job)
        except BaseException as error:
            self._failed(error)


class Limit(NamedTuple):
    """How many jobs may wait, of how many bytes together, and how many seconds before the work in hand is hurried.

    A job is overtaken where newer ones of its lane wait, more than ``behind`` says of that lane.
    """

    jobs: int
    nbytes: int
    patience_s: float
    behind: Mapping[Hashable, int] = MappingProxyType({})


class _Waiting(NamedTuple, Generic[Job]):
    job: Job
    nbytes: int
    since: float
    lane: Hashable
    number: int  # of its `put`; 0 for what was given back


class Backlog(Generic[Job]):
    """Runs ``work`` on the newest job, and before it ``settle`` on each that it overtook, the oldest first.

    Jobs of different lanes (``lane_of``) take turns, and never overtake each other.

    Memory is bounded: a caller who puts a job beyond the ``limit`` waits until there is space, and the current work is
    `hurried` meanwhile. ``nbytes_of`` gives the size of a job; one that is larger than the limit waits alone.

    ``nice`` is the niceness of the thread and of all that it starts (0 to 19; where threads have that). Niceness
    cannot be taken back, and a nice thread never runs on a processor that others fill. So there are two threads, one
    at a time: the nice one as long as no job is overtaken, the other one from when a job is until none was for
    `PRESSED_S`.

    What ``work`` or ``settle`` raises closes the backlog and goes to ``failed``.
    """

    def __init__(
        self,
        work: Callable[[Job], None],
        settle: Callable[[Job], None],
        failed: Callable[[BaseException], None],
        limit: Limit,
        nbytes_of: Callable[[Job], int],
        nice: int = 0,
        lane_of: Callable[[Job], Hashable] = lambda job: None,
    ) -> None:
        self._work, self._settle, self._failed = work, settle, failed
        self._limit, self._nbytes_of, self._nice, self._lane_of = limit, nbytes_of, nice, lane_of
        self._served = Counter[Hashable]()  # the turn in which each lane had its last one
        self._turns = self._puts = 0
        self._changed = threading.Condition()
        self._waiting: deque[_Waiting[Job]] = deque()
        self._nbytes = 0  # of all that wait
        self._busy, self._open = False, True
        self._begun, self._begun_at = 0, 0.0  # the number of the job in hand, and since when it is
        self._overtaken_at = -PRESSED_S
        self._pressed = False  # as of the last `put`
        self._threads = [
            threading.Thread(target=self._run, args=(pressed,), name="backlog", daemon=True)
            for pressed in (False, True)
        ]
        for thread in self._threads:
            thread.start()

    def __len__(self) -> int:
        """How many jobs wait."""
        return len(self._waiting)

    def put(self, job: Job) -> None:
        """Hand over a job; waits while the limit is reached, unless the backlog is closed."""
        nbytes = self._nbytes_of(job)
        with self._changed:
            self._changed.wait_for(lambda: not self._open or self._has_space(nbytes))
            now, lane = time.monotonic(), self._lane_of(job)
            if self._is_behind(lane):
                self._overtaken_at = now
            self._pressed = now - self._overtaken_at < PRESSED_S
            self._puts += 1
            self._waiting.append(_Waiting(job, nbytes, now, lane, self._puts))
            self._nbytes += nbytes
            self._changed.notify_all()

    def hurried(self) -> bool:
        """Whether the current work is to end soon: the backlog is closed, or jobs are overtaken and more must wait.

        That is where the oldest job has waited for the limit's patience, or the newest has no space. ``work`` asks.
        """
        with self._changed:
            if not self._open:
                return True
            if not self._pressed or not self._waiting:
                return False
            waited_s = time.monotonic() - max(self._waiting[0].since, self._begun_at)  # for this work, not others
            return waited_s >= self._limit.patience_s or not self._has_space(self._waiting[-1].nbytes)

    def rest(self) -> list[Job]:
        """Take back every job that has not begun, the oldest first."""
        with self._changed:
            jobs = [waiting.job for waiting in self._waiting]
            self._waiting.clear()
            self._nbytes = 0
            self._changed.notify_all()
        return jobs

    def give_back(self, jobs: Iterable[Job]) -> None:
        """What `rest` took, before all that came since; never waits."""
        now = time.monotonic()
        with self._changed:
            back = [_Waiting(job, self._nbytes_of(job), now, self._lane_of(job), 0) for job in jobs]
            self._waiting.extendleft(reversed(back))
            self._nbytes += sum(waiting.nbytes for waiting in back)
            self._changed.notify_all()

    def drain(self) -> None:
        """Wait until every job that was put by now is done, or the backlog is closed."""
        with self._changed:
            last = self._puts
            self._changed.wait_for(lambda: not self._open or not self._has_any_of(last))

    def shut(self) -> None:
        """Begin no job any more, hurry the one in hand, let nobody wait; does not wait for it."""
        with self._changed:
            self._open = False
            self._changed.notify_all()

    def close(self) -> None:
        """Finish the job in hand, leave those that wait, end the threads."""
        self.shut()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()

    def _has_space(self, nbytes: int) -> bool:
        if not self._waiting:
            return True
        return len(self._waiting) < self._limit.jobs and self._nbytes + nbytes <= self._limit.nbytes

    def _has_any_of(self, last: int) -> bool:
        """Whether a job up to this number waits, or is in hand."""
        return (self._busy and self._begun <= last) or any(waiting.number <= last for waiting in self._waiting)

    def _is_behind(self, lane: Hashable) -> bool:
        """Whether so many jobs of a lane wait that the one before them is overtaken."""
        return sum(waiting.lane == lane for waiting in self._waiting) > self._limit.behind.get(lane, 0)

    def _next(self) -> int:
        """Which job is next: the oldest of the lane whose last turn is the longest ago."""
        first = {waiting.lane: k for k, waiting in reversed(list(enumerate(self._waiting)))}
        return first[min(first, key=lambda lane: (self._served[lane], first[lane]))]

    def _take(self, pressed: bool) -> tuple[Callable[[Job], None], Job] | None:
        """The next job and what to do with it; those behind it stay in the queue, whatever this one raises."""
        with self._changed:
            mine = lambda: self._waiting and not self._busy and self._pressed is pressed  # noqa: E731
            self._changed.wait_for(lambda: not self._open or mine())
            if not self._open:
                return None
            self._busy = True
            chosen = self._next()
            job, nbytes, _, lane, self._begun = self._waiting[chosen]
            self._begun_at = time.monotonic()
            del self._waiting[chosen]
            self._nbytes -= nbytes
            self._turns += 1
            self._served[lane] = self._turns
            self._changed.notify_all()
            return self._settle if self._is_behind(lane) else self._work, job

    def _run(self, pressed: bool) -> None:
        try:
            if not pressed:
                give_way(self._nice)
            while (taken := self._take(pressed)) is not None:
                do, job = taken
                do(job)
                self._finish()
        except BaseException as error:
            self.shut()
            self._failed(error)

    def _finish(self) -> None:
        with self._changed:
            self._busy = False
            self._changed.notify_all()


def give_way(nice: int) -> None:
    """Set the niceness of this thread and of all that it starts from now on (0 to 19; where threads have that)."""
    if nice and sys.platform == "linux":  # elsewhere niceness is a process's
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), nice)
