# SPDX-License-Identifier: Apache-2.0
"""One topic measured in a process of its own, within a time limit."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import figure_results
from figure_topics.topic import QUICK, REPOSITORY, Topic, shared_folder

OUT = REPOSITORY / "out/figures"
STOP = threading.Event()  # set where the run is ended: what is running ends, too
SEED = re.compile(r"--(?:first-)?seeds? (\d+(?:,\d+)*)|[a-z-]+:(\d+(?:,\d+)*)")


class TopicError(Exception):
    """Why a topic has no figures: its command failed, took too long, or its JSON has not what the rows ask for."""


def measure(topic: Topic, size: str, code: str, limit_factor: float) -> figure_results.Result:
    """Run the topic's command and keep what its rows need; `TopicError` where there is nothing to keep."""
    folder = OUT / code / size
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{topic.name}.json"
    argv = topic.argv(size, file, folder / topic.name, shared_folder())
    limit_s = 60 * limit_factor * topic.minutes[0 if size == QUICK else 1]
    file.unlink(missing_ok=True)
    load, seconds, processor_seconds = _run(argv, OUT / f"{topic.name}.log", limit_s, (0, 1) if topic.judges else (0,))
    result = figure_results.Result(
        topic=topic.name,
        version=figure_results.version(),
        commit=figure_results.commit(),
        code=code,
        size=size,
        command=topic.command(size),
        seeds=seeds_of(topic.command(size)),
        date=datetime.now(UTC).date().isoformat(),
        machine=figure_results.machine(),
        cores=len(os.sched_getaffinity(0)),
        load=round(load, 1),
        seconds=round(seconds, 1),
        processor_seconds=round(processor_seconds, 1),
        figures=figures_of(topic, file),
    )
    result.write()
    return result


def figures_of(topic: Topic, raw: Path) -> dict[str, dict[str, float | str]]:
    """The values of each row."""
    try:
        found = json.loads(raw.read_text(encoding="utf-8"))
        return {row.key: row.taken(found) for row in topic.rows}
    except (OSError, ValueError, LookupError, TypeError, ZeroDivisionError) as error:
        raise TopicError(f"expected its rows in {raw}, got {type(error).__name__}: {error}") from error


def seeds_of(command: str) -> list[int]:
    """The seeds that a command names."""
    found = [one or several for one, several in SEED.findall(command)]
    return [int(seed) for text in found for seed in text.split(",")]


def _run(argv: list[str], log: Path, limit_s: float, ends: tuple[int, ...]) -> tuple[float, float, float]:
    """The load before it, the seconds that it took, and those of the processor."""
    path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH", ""))))
    load, start_s = os.getloadavg()[0], time.monotonic()
    with log.open("w", encoding="utf-8") as stream:
        process = subprocess.Popen(
            [sys.executable, *argv],
            cwd=REPOSITORY,
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # so that all that it started ends with it
        )
        try:
            used = _wait(process, start_s + limit_s)
        except BaseException:
            _end(process)
            raise
    _end(process)
    if used is None and STOP.is_set():
        raise TopicError("stopped; the next run measures it")
    if used is None:
        raise TopicError(f"expected an end within {limit_s:.0f} s, got none; see {log}")
    if process.returncode not in ends:
        raise TopicError(f"expected exit status {' or '.join(map(str, ends))}, got {process.returncode}; see {log}")
    return load, time.monotonic() - start_s, used


def _wait(process: subprocess.Popen[bytes], until_s: float) -> float | None:
    """The seconds of the processor that it and its ended children took; None where it has not ended in time."""
    while time.monotonic() < until_s and not STOP.is_set():
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return usage.ru_utime + usage.ru_stime
        time.sleep(0.2)
    return None


def _end(process: subprocess.Popen[bytes]) -> None:
    """End all that the command started and left."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
    if process.returncode is None:
        process.wait()
