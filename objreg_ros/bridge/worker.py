# SPDX-License-Identifier: Apache-2.0
"""One thread for the work of a node, so that its subscriptions never wait for it. Knows no ROS."""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Job = TypeVar("Job")


class Worker(Generic[Job]):
    """Runs ``work`` on the newest job. A job that a newer one overtakes goes to ``replaced`` instead.

    What ``work`` raises ends the worker and goes to ``failed``: a bug is not to be survived in silence. ``nice`` is how
    far the thread, and all that it starts, gives way to others for the processor (0 to 19; where threads have that).
    """

    def __init__(
        self,
        work: Callable[[Job], None],
        replaced: Callable[[Job], None],
        failed: Callable[[BaseException], None],
        nice: int = 0,
    ) -> None:
        self._work, self._replaced, self._failed, self._nice = work, replaced, failed, nice
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

    def _give_way(self) -> None:
        if self._nice and sys.platform == "linux":  # elsewhere niceness is a process's
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), self._nice)

    def _run(self) -> None:
        try:
            self._give_way()
            while (job := self._take()) is not None:
                self._work(job)
        except BaseException as error:
            self._failed(error)


class Backlog(Worker[Job]):
    """Runs ``work`` on the newest job, and before it ``settle`` on each that it overtook, the oldest first."""

    def __init__(
        self,
        work: Callable[[Job], None],
        settle: Callable[[Job], None],
        failed: Callable[[BaseException], None],
        nice: int = 0,
    ) -> None:
        self._waiting: deque[Job] = deque()
        self._busy = False
        self._newest, self._settle = work, settle
        super().__init__(self._by_age, settle, failed, nice)

    def put(self, job: Job) -> None:
        """Hand over a job; never waits."""
        with self._ready:
            self._waiting.append(job)
            self._ready.notify_all()

    def rest(self) -> list[Job]:
        """Take back every job that has not begun, the oldest first."""
        with self._ready:
            waiting = list(self._waiting)
            self._waiting.clear()
        return waiting

    def drain(self) -> None:
        """Wait until every job is done, or the worker is closed."""
        with self._ready:
            self._ready.wait_for(lambda: not (self._waiting or self._busy) or not self._open)

    def _take(self) -> Job | None:
        """The oldest job; with those behind it still in the queue, so that none is lost whatever this one raises."""
        with self._ready:
            self._ready.wait_for(lambda: self._waiting or not self._open)
            self._busy = self._open
            return self._waiting.popleft() if self._open else None

    def _by_age(self, job: Job) -> None:
        (self._settle if self._waiting else self._newest)(job)
        with self._ready:
            self._busy = False
            self._ready.notify_all()
