# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable

import pytest

from objreg_ros.bridge.node.worker import Backlog, Limit, Worker, give_way

PATIENCE = 10.0  # seconds; a test that gets there has failed
ROOMY = Limit(jobs=100, nbytes=10**9, patience_s=100.0)


class Bench:
    """A worker whose job is held until it is let go."""

    def __init__(self) -> None:
        self.begun, self.go, self.failed = threading.Event(), threading.Event(), threading.Event()
        self.done: list[str] = []
        self.replaced: list[str] = []
        self.error: BaseException | None = None
        self.worker: Worker[str] = Worker(self.work, self.replaced.append, self.fail)

    def work(self, job: str) -> None:
        self.begun.set()
        assert self.go.wait(PATIENCE)
        if job == "bug":
            raise RuntimeError("a bug")
        self.done.append(job)

    def fail(self, error: BaseException) -> None:
        self.error = error
        self.failed.set()


def test_while_one_job_is_in_hand_the_newest_of_the_others_waits_and_the_rest_is_handed_back() -> None:
    bench = Bench()
    bench.worker.put("first")
    assert bench.begun.wait(PATIENCE)
    for job in ("second", "third", "fourth"):
        bench.worker.put(job)
    assert bench.replaced == ["second", "third"]
    bench.begun.clear()
    bench.go.set()
    assert bench.begun.wait(PATIENCE)
    bench.worker.close()
    assert bench.done == ["first", "fourth"]


def test_jobs_that_come_one_at_a_time_are_all_done() -> None:
    done: list[int] = []
    came = threading.Semaphore(0)
    replaced: list[int] = []

    def work(job: int) -> None:
        done.append(job)
        came.release()

    worker: Worker[int] = Worker(work, replaced.append, print)
    for job in range(1, 50):
        worker.put(job)
        assert came.acquire(timeout=PATIENCE)
    worker.close()
    assert done == list(range(1, 50)) and not replaced


def test_what_the_work_raises_is_not_swallowed() -> None:
    bench = Bench()
    bench.go.set()
    bench.worker.put("bug")
    assert bench.failed.wait(PATIENCE) and str(bench.error) == "a bug"


def test_closing_leaves_the_job_that_waits_undone() -> None:
    bench = Bench()
    bench.worker.put("first")
    assert bench.begun.wait(PATIENCE)
    bench.worker.put("second")
    threading.Timer(0.05, bench.go.set).start()
    bench.worker.close()
    assert bench.done == ["first"]


class Overtaken:
    """A backlog that holds its first job until ``go``, while 2, 3 and 4 overtake each other behind it."""

    def __init__(self, settle: Callable[[int], object] | None = None, limit: Limit = ROOMY) -> None:
        self.go, self.over = threading.Event(), threading.Event()
        self.done: list[tuple[str, int]] = []
        begun = threading.Event()

        def work(job: int) -> None:
            begun.set()
            assert self.go.wait(PATIENCE)
            self.done.append(("work", job))
            if job == 4:
                self.over.set()

        noted: Callable[[int], object] = lambda job: self.done.append(("settle", job))  # noqa: E731
        self.backlog: Backlog[int] = Backlog(work, settle or noted, lambda error: self.over.set(), limit, lambda job: 1)
        self.backlog.put(1)
        assert begun.wait(PATIENCE)
        for job in (2, 3, 4):
            self.backlog.put(job)

    def go_on(self) -> None:
        """Let it go until it has done the last job, or broken off."""
        self.go.set()
        assert self.over.wait(PATIENCE)
        self.backlog.close()


def test_a_backlog_settles_what_was_overtaken_before_it_works_on_the_newest() -> None:
    held = Overtaken()
    held.go_on()
    assert held.done == [("work", 1), ("settle", 2), ("settle", 3), ("work", 4)] and held.backlog.rest() == []


def test_who_drains_a_backlog_waits_for_the_last_job() -> None:
    held = Overtaken()
    threading.Timer(0.05, held.go.set).start()
    held.backlog.drain()
    assert held.done[-1] == ("work", 4)
    held.backlog.drain()  # there is nothing to wait for
    held.backlog.close()
    held.backlog.drain()


def test_a_closed_backlog_gives_back_what_it_did_not_begin() -> None:
    held = Overtaken()
    rest = held.backlog.rest()
    held.go.set()
    held.backlog.close()
    assert rest == [2, 3, 4] and held.done == [("work", 1)]


def test_a_backlog_that_breaks_off_gives_back_all_that_it_did_not_begin() -> None:
    def settle(job: int) -> None:
        raise RuntimeError("ROS is down")

    held = Overtaken(settle)
    held.go_on()
    assert held.backlog.rest() == [3, 4]


def test_what_was_taken_back_and_is_given_back_comes_before_what_came_since() -> None:
    held = Overtaken()
    taken = held.backlog.rest()
    held.backlog.put(5)
    held.backlog.give_back(taken)
    assert len(held.backlog) == 4 and held.backlog.rest() == [2, 3, 4, 5]
    held.go.set()
    held.backlog.close()


@pytest.mark.parametrize("limit", [Limit(3, 10**9, 100.0), Limit(100, 3, 100.0)], ids=["by count", "by bytes"])
def test_who_puts_a_job_beyond_the_limit_waits_until_there_is_room(limit: Limit) -> None:
    held, put = Overtaken(limit=limit), threading.Event()
    assert held.backlog.hurried()  # it is full
    putting = threading.Thread(target=lambda: (held.backlog.put(5), put.set()))
    putting.start()
    assert not put.wait(0.1) and len(held.backlog) == 3
    held.go.set()
    assert put.wait(PATIENCE)
    held.backlog.drain()
    held.backlog.close()
    assert [job for _, job in held.done] == [1, 2, 3, 4, 5]


def test_a_job_that_is_larger_than_the_limit_waits_alone() -> None:
    done: list[str] = []
    backlog: Backlog[str] = Backlog(done.append, done.append, print, Limit(10, 2, 100.0), len)
    for job in ("large", "larger"):
        backlog.put(job)
    backlog.drain()
    backlog.close()
    assert done == ["large", "larger"]


def test_nobody_waits_for_room_in_a_backlog_that_is_shut() -> None:
    held = Overtaken(limit=Limit(3, 10**9, 100.0))
    putting = threading.Thread(target=held.backlog.put, args=(5,))
    putting.start()
    held.backlog.shut()
    putting.join(PATIENCE)
    assert not putting.is_alive() and held.backlog.hurried() and held.backlog.rest() == [2, 3, 4, 5]
    held.go.set()
    held.backlog.close()
    assert held.done == [("work", 1)]


def test_work_is_hurried_when_what_was_overtaken_has_waited_enough() -> None:
    for patience_s, is_hurried in ((100.0, False), (0.0, True)):
        held = Overtaken(limit=ROOMY._replace(patience_s=patience_s))
        assert held.backlog.hurried() is is_hurried
        held.go.set()
        held.backlog.close()


def test_work_is_not_hurried_by_one_job_that_overtook_none() -> None:
    """As in a lossless replay, whose outcome depends on no time."""
    begun, go, asked = threading.Event(), threading.Event(), list[bool]()

    def work(job: int) -> None:
        begun.set()
        assert go.wait(PATIENCE)
        asked.append(backlog.hurried())

    backlog: Backlog[int] = Backlog(work, work, print, Limit(1, 1, 0.0), lambda job: 1)
    backlog.put(1)
    assert begun.wait(PATIENCE)
    backlog.put(2)
    go.set()
    backlog.drain()
    backlog.close()
    assert asked == [False, False]


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no niceness of their own")
def test_once_a_job_was_overtaken_the_next_ones_do_not_give_way() -> None:
    seen: list[tuple[int, int]] = []
    begun, go = threading.Event(), threading.Event()

    def work(job: int) -> None:
        seen.append((job, os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))
        begun.set()
        assert go.wait(PATIENCE)

    backlog: Backlog[int] = Backlog(work, work, print, ROOMY, lambda job: 1, nice=19)
    backlog.put(1)
    assert begun.wait(PATIENCE)
    backlog.put(2)
    backlog.put(3)
    go.set()
    backlog.drain()
    backlog.put(4)  # soon after: still pressed
    backlog.drain()
    backlog.close()
    plain = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    assert seen == [(1, 19), (2, plain), (3, plain), (4, plain)] and plain < 19


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no niceness of their own")
def test_a_thread_that_gives_way_and_those_that_it_starts_are_nice() -> None:
    seen: list[int] = []

    def note() -> None:
        seen.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    def work() -> None:
        give_way(19)
        note()
        helper = threading.Thread(target=note)
        helper.start()
        helper.join()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [19, 19]
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) < 19


@pytest.mark.parametrize(
    ("behind", "jobs", "expected"),
    [
        (9, "a1 a2 a3 b1 b2 c1", "a0 b1 c1 a1 b2 a2 a3"),
        (1, "a1 a2 a3 b1 b2", "a0 b1 (a1) b2 a2 a3"),  # in brackets what is settled
    ],
)
def test_lanes_take_turns_and_what_a_lane_is_too_far_behind_with_is_settled(
    behind: int, jobs: str, expected: str
) -> None:
    begun, go, done = threading.Event(), threading.Event(), list[str]()

    def work(job: str) -> None:
        begun.set()
        go.wait(PATIENCE)
        done.append(job)

    def settle(job: str) -> None:
        done.append(f"({job})")

    limit = Limit(99, 10**9, 1e9, dict.fromkeys("abc", behind))
    backlog = Backlog(work, settle, print, limit, len, lane_of=lambda job: job[0])
    backlog.put("a0")
    assert begun.wait(PATIENCE)
    for job in jobs.split():
        backlog.put(job)
    go.set()
    backlog.drain()
    backlog.close()
    assert " ".join(done) == expected


def test_work_in_hand_is_hurried_by_how_long_others_wait_for_it_and_not_for_those_before() -> None:
    begun, go, asked = threading.Event(), threading.Event(), list[bool]()
    limit = Limit(99, 10**9, patience_s=0.3, behind={"a": 2})

    def work(job: str) -> None:
        begun.set()
        assert go.wait(PATIENCE)
        asked.append(backlog.hurried())

    backlog = Backlog(work, lambda job: None, print, limit, len, lane_of=lambda job: job[0])
    backlog.put("a0")
    assert begun.wait(PATIENCE)
    for k in range(1, 5):
        backlog.put(f"a{k}")
    time.sleep(0.4)  # all wait longer than the patience by now
    go.set()
    backlog.drain()
    backlog.close()
    assert asked == [True, False, False, False]


def test_who_drains_does_not_wait_for_what_is_put_meanwhile() -> None:
    backlog: Backlog[str] = Backlog(lambda job: time.sleep(0.01), lambda job: None, print, ROOMY, len)
    ended, drained = threading.Event(), threading.Event()

    def feed() -> None:
        while not ended.wait(0.002):
            backlog.put("job")

    def drain() -> None:
        backlog.drain()
        drained.set()

    threads = [threading.Thread(target=work) for work in (feed, drain)]
    for thread in threads:
        thread.start()
        time.sleep(0.1)
    in_time = drained.wait(30.0)
    ended.set()
    for thread in threads:
        thread.join()
    backlog.close()
    assert in_time
