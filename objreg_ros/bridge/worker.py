# SPDX-License-Identifier: Apache-2.0
"""One thread for the work of a node, so that its subscriptions never wait for it. Knows no ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Job = TypeVar("Job")


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

    def clear(self) -> Job | None:
        """Take back the job that has not begun, if there is one."""
        with self._ready:
            waiting, self._next = self._next, None
        return waiting

    def close(self) -> None:
        """Finish the job in hand, leave the one that waits, end the thread."""
        with self._ready:
            self._open = False
            self._ready.notify()
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
