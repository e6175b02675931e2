# SPDX-License-Identifier: Apache-2.0
"""Tests of how runs over many recordings are compared."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pyarrow
import pyarrow.parquet
import pytest


@pytest.fixture
def batch() -> ModuleType:
    return importlib.import_module("batch")


def written(folder: Path, odds: list[float]) -> Path:
    """A run that found so many constraints with these odds, and as many refusals."""
    folder.mkdir()
    for name in ("constraints", "refusals"):
        pyarrow.parquet.write_table(pyarrow.table({"odds": odds}), folder / f"{name}.parquet")
    return folder


def test_two_runs_are_the_same_only_to_the_last_digit(batch: ModuleType, tmp_path: Path) -> None:
    first = written(tmp_path / "1", [0.5, 0.25])
    assert batch.same(first, written(tmp_path / "2", [0.5, 0.25]))
    assert not batch.same(first, written(tmp_path / "close", [0.5, 0.25 + 1e-15]))
    assert not batch.same(first, written(tmp_path / "fewer", [0.5]))


def test_one_worker_is_killed_when_so_many_have_ended(batch: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    processes = [SimpleNamespace(name=name, pid=pid) for name, pid in (("other", 1), ("Dask Worker", 2), ("Dask", 3))]
    killed: list[tuple[int, int]] = []
    monkeypatch.setattr(multiprocessing, "active_children", lambda: processes)
    monkeypatch.setattr(os, "kill", lambda pid, number: killed.append((pid, number)))
    receive = batch.Killer(2)
    for ended in (1, 2, 3):
        receive(ended)
    assert killed == [(2, signal.SIGKILL)]


def test_a_run_is_reported_by_how_much_faster_it_was_than_the_first(batch: ModuleType) -> None:
    first = {"seconds": 90.0, "recording_s": 10.0, "constraints": 7, "same": True}
    line = batch.line("2", {"seconds": 60.0, "recording_s": 12.5, "constraints": 6, "same": False}, first)
    assert line.split() == ["2", "60.0", "1.50", "12.50", "6", "NO"]
    assert batch.line("1", first, first).split() == ["1", "90.0", "1.00", "10.00", "7", "yes"]


def test_a_recording_without_a_result_is_an_error(batch: ModuleType, tmp_path: Path) -> None:
    work = batch.BatchWork.of(batch.RecordedOptions(batch.read_settings(None, [])), tmp_path, ())
    with pytest.raises(OSError, match="gone: expected its result, got none"):
        batch._written(work, [tmp_path / "gone"])


def test_what_was_simulated_is_not_simulated_again(
    batch: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []

    def simulate(path: Path, scenario: str, seed: int, frames: int, **_: object) -> None:
        made.append(seed)
        path.mkdir()

    monkeypatch.setattr(batch, "simulate", simulate)
    assert [path.name for path in batch.simulated(tmp_path, 2, 9)] == ["loop_0_9", "loop_1_9"]
    assert len(batch.simulated(tmp_path, 3, 9)) == 3 and made == [0, 1, 2]
