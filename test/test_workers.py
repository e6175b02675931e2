# SPDX-License-Identifier: Apache-2.0
"""Work that is spread over processes: every item's end is reported, whatever becomes of the process."""

from __future__ import annotations

import os
import signal
import sys
from functools import partial
from pathlib import Path

import pytest
from distributed import LocalCluster

from objreg_tools import workers
from objreg_tools.workers import LIVES, Done, report_progress, spread


def halve(number: int) -> int:
    """Half of an even number."""
    if number % 2:
        raise ValueError(f"expected an even number, got {number}")
    return number // 2


def die(folder: Path, deaths: int, item: int) -> int:
    """The item; the process dies before that, the first ``deaths`` times that an odd one comes."""
    mark = folder / f"{item}_{os.getpid()}"
    if item % 2 and len(list(folder.glob(f"{item}_*"))) < deaths:
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def stumble(item: int) -> int:
    """Raises an error whose cause is one that cannot be sent to another process."""
    behind = KeyError(lambda: item)
    behind.__cause__ = behind
    raise ValueError(f"expected another item, got {item}") from behind


def count_to(number: int) -> int:
    """The number, with a report at each step."""
    for done in range(1, number + 1):
        report_progress(done, number)
    return number


def test_no_item_needs_no_worker() -> None:
    assert list(spread(halve, [], scheduler="tcp://nowhere:1")) == []


def test_two_workers_report_every_item_and_an_error_stops_no_other() -> None:
    done_items = {done.item: done for done in spread(halve, [2, 3, 4, 6], workers=2)}
    assert {item: done.value for item, done in done_items.items()} == {2: 1, 3: None, 4: 2, 6: 3}
    with pytest.raises(ValueError, match="expected an even number, got 3"):
        done_items[3].result()


def test_an_error_comes_back_whatever_is_behind_it() -> None:
    (done,) = spread(stumble, [1], workers=1)
    assert isinstance(done.error, ValueError) and str(done.error) == "expected another item, got 1"


def test_a_worker_that_is_killed_costs_its_item_alone_and_one_that_kills_all_is_given_up(tmp_path: Path) -> None:
    once, ever = tmp_path / "once", tmp_path / "ever"
    once.mkdir(), ever.mkdir()
    results = sorted(done.result() for done in spread(partial(die, once, 1), [0, 1, 2], workers=2))
    assert results == [0, 1, 2] and len(list(once.iterdir())) == 1
    given_up = {done.item: done for done in spread(partial(die, ever, LIVES), [0, 1, 2], workers=1)}
    assert [given_up[item].value for item in (0, 1, 2)] == [0, None, 2]
    assert f"{LIVES} workers died at it" in str(given_up[1].error) and len(list(ever.iterdir())) == LIVES


def test_any_cluster_is_taken_by_its_address() -> None:
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        finished = spread(os.path.basename, ["a/b"], scheduler=cluster.scheduler_address)
        assert [done.result() for done in finished] == ["b"]


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "PATIENCE_S", 0.2)
    with pytest.raises(OSError, match=r"tcp://127\.0\.0\.1:1: expected a Dask scheduler with workers, got none"):
        list(spread(halve, [2], scheduler="tcp://127.0.0.1:1"))


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"pip install 'objreg_ros\[batch\]' brings it"):
        list(spread(halve, [2]))


def test_a_result_is_the_value_of_the_work() -> None:
    assert Done("item", 3).result() == 3


def test_the_end_of_each_item_is_among_its_reports_and_not_each_step() -> None:
    seen: list[tuple[int, ...]] = []
    ended = spread(count_to, [50, 20], workers=2, on_progress=lambda *row: seen.append(row))
    assert (
        sorted(done.result() for done in ended) == [20, 50]
        and {(0, 50, 50), (1, 20, 20)} <= set(seen)
        and len(seen) < 20
    )


def test_an_ended_item_is_the_one_that_was_given_and_no_copy(tmp_path: Path) -> None:
    item = tmp_path / "a"
    (done,) = spread(os.path.basename, [item], workers=1)
    assert done.item is item and done.value == "a"


def test_a_report_without_workers_is_none() -> None:
    assert count_to(3) == 3
