# SPDX-License-Identifier: Apache-2.0
"""Work spread over processes and machines by Dask, one item at a time in each, one thread an item.

A worker that dies costs the item that it was at: another takes it up, unless it has ended `LIVES` workers.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any, Generic, TypeVar
from uuid import uuid4

from objreg_ros import extra

Item = TypeVar("Item")
Value = TypeVar("Value")

LIVES = 3  # workers that may die at one item before it is given up
PATIENCE_S = 30  # for a scheduler and the first of its workers
REPORT_S = 0.5  # between two reports of one item
RULES = {
    "distributed.scheduler.allowed-failures": LIVES - 1,
    "distributed.scheduler.worker-saturation": 1.0,  # what waits is with no worker, so none of it dies with one
    "distributed.admin.low-level-log-length": 0,
}
OnProgress = Callable[[int, int, int], None]
"""Takes the number of an item among all, how much of it is done, and how much there is to do."""
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@dataclass(frozen=True, slots=True)
class Done(Generic[Item, Value]):
    """What became of an item: the ``value`` of the work, or the ``error`` that it raised."""

    item: Item
    value: Value | None = None
    error: Exception | None = None

    def result(self) -> Value:
        """The value; the error is raised where there is one."""
        if self.error is not None:
            raise self.error
        return self.value  # type: ignore[return-value]  # the work has ended, so it is what that gave


@dataclass(slots=True)
class _Reports:
    """Where an item that is being worked at says how far it is: a topic of Dask, and its own number."""

    topic: str
    number: int
    last_s: float = -REPORT_S

    def send(self, done: int, total: int) -> None:
        now_s = time.monotonic()
        if done < total and now_s - self.last_s < REPORT_S:
            return
        self.last_s = now_s
        require_dask().get_worker().log_event(self.topic, (self.number, done, total))


_reports: ContextVar[_Reports | None] = ContextVar("_reports", default=None)


def report_progress(done: int, total: int) -> None:
    """From within the work: how far its item is, in units of its own. Does nothing where nobody asked for it."""
    if (reports := _reports.get()) is not None:
        reports.send(done, total)


def require_dask() -> ModuleType:
    """Dask's distributed; ValueError that names the extra where it is not installed."""
    return extra.load("distributed", "batch", "work over processes by Dask")


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0))


def spread(
    work: Callable[[Item], Value],
    items: Sequence[Item],
    workers: int | None = None,
    scheduler: str = "",
    on_progress: OnProgress | None = None,
) -> Iterator[Done[Item, Value]]:
    """What became of each item, in the order in which they end.

    By default ``workers`` processes of this machine, one for each core; else those of the Dask cluster at
    ``scheduler``, like ``tcp://host:8786``. An exception of the work is the item's ``error``. Work may be done more
    than once where a worker dies, so what it writes it must write whole. What the work says by `report_progress` comes
    to ``on_progress``, in a thread of its own, some times a second. ValueError without Dask, OSError where no
    scheduler or no worker answers.
    """
    if not items:
        return
    with _client(min(workers or cores(), len(items)), scheduler) as client:
        topic = f"objreg-{uuid4().hex}" if on_progress else ""
        if on_progress:
            client.subscribe_topic(topic, lambda event: on_progress(*event[1]))
        futures = client.map(partial(_alone, work, topic), range(len(items)), items, pure=False)
        item_of = {future.key: item for future, item in zip(futures, items, strict=True)}
        for future in require_dask().as_completed(futures, loop=client.loop):
            yield _done(item_of[future.key], future)


def _done(item: Item, future: Any) -> Done[Item, Any]:
    distributed = require_dask()
    try:
        ended = future.result()
        return Done(item, ended.value, ended.error)  # the item itself, not the copy that has travelled
    except distributed.KilledWorker:
        return Done(item, error=OSError(f"{LIVES} workers died at it; it may need more memory than there is"))
    except Exception as error:  # whatever kept Dask from bringing the result
        return Done(item, error=error)


def _alone(work: Callable[[Item], Value], topic: str, number: int, item: Item) -> Done[Item, Value]:
    """The work in one thread; its exception comes back alone: raised, Dask would log it with its stack."""
    import cv2

    cv2.setNumThreads(1)
    before = _reports.set(_Reports(topic, number) if topic else None)
    try:
        return Done(item, work(item))
    except Exception as error:  # a bug at one item is no reason to lose the others
        error.__cause__ = error.__context__ = None  # those of libraries may be none that can be sent
        return Done(item, error=error)
    finally:
        _reports.reset(before)


@contextmanager
def _client(workers: int, scheduler: str) -> Iterator[Any]:
    """A client of the cluster at ``scheduler``, or of one of this machine that ends with the block."""
    distributed = require_dask()
    import dask

    with dask.config.set(RULES), ExitStack() as stack:
        place = scheduler or stack.enter_context(_own(distributed, workers))
        try:
            client = stack.enter_context(distributed.Client(place, timeout=PATIENCE_S, set_as_default=False))
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except (OSError, ValueError, TimeoutError) as error:
            problem = f"{scheduler or 'the local cluster'}: expected a Dask scheduler with workers, got none: {error}"
            raise OSError(f"{problem}; start them with `dask scheduler` and `dask worker`") from error
        yield client


def _own(distributed: ModuleType, workers: int) -> Any:
    """Processes of this machine. What they say is not received: what became of the work comes back."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        memory_limit=0,  # a long run is not stopped for what it may need
        dashboard_address="127.0.0.1:0",  # None would take port 8787, and warn where that is in use
        silence_logs=logging.CRITICAL,
        env=ONE_THREAD,
    )
