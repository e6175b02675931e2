# SPDX-License-Identifier: Apache-2.0
"""Trials of a target by processes that may die: how many there were, and what went wrong in which.

A trial is made of a seed alone, so that each can be run again. It may give anything or raise ValueError or OSError
(refused). Whatever else it does is a finding: another exception (``bug``), the end of the process (``death``), more
than `PATIENCE_S` seconds (``hang``), more than `GREED_MB` of memory (``greed``), an answer that is not true
without an error (``wrong``), or a file written outside of the folder that it was given (``outside``).
"""

from __future__ import annotations

import faulthandler
import json
import mmap
import multiprocessing
import os
import random
import re
import resource
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from fence import Fence

PATIENCE_S = 5.0  # of the processor; of the clock where a trial only waits:
WAITING_S = 30.0
PREPARING_S = 600.0  # a first start compiles kernels
GREED_MB = 500
MEMORY = 4 << 30  # bytes of addresses beyond those that a process has when it begins
PACKAGE = re.compile(r".*/(?=objreg_(?:ros|mapper|tools)/)")  # what comes before a file of ours
KEPT_SEEDS = 5  # of findings that are alike
MANY = 1 << 60
KINDS = ("bug", "death", "hang", "greed", "wrong", "outside")
TICKS = os.sysconf("SC_CLK_TCK")

Attempt = Callable[[random.Random], None]


class WrongAnswerError(Exception):
    """What was read or computed is not true, and nobody said so."""


class LateError(Exception):
    """An answer came, but later than `PATIENCE_S`."""


class OutsideError(Exception):
    """A file was changed that was not to be written."""


class NoTrialError(Exception):
    """What came of the dice is no input at all: the transport would not have delivered it."""


@dataclass(frozen=True)
class Target:
    """What is attacked. ``prepare`` gets an empty folder and gives what one trial does."""

    name: str
    prepare: Callable[[Path], Attempt]
    share: float = 1.0  # of the time


@dataclass
class Tally:
    """What came of the trials of one target."""

    tries: int = 0
    refused: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    findings: dict[tuple[str, str, str], dict[str, Any]] = field(default_factory=dict)

    def find(self, seed: int, kind: str, what: str, where: str) -> None:
        """Count a finding; those that are alike share a row."""
        self.counts[kind] += 1
        new = {"kind": kind, "what": what, "where": where, "count": 0, "seeds": []}
        row = self.findings.setdefault((kind, what.split(":")[0], where), new)
        row["count"] += 1
        if len(row["seeds"]) < KEPT_SEEDS:
            row["seeds"].append(seed)

    def row(self) -> dict[str, Any]:
        """Numbers and findings, the most frequent first."""
        found = sorted(self.findings.values(), key=lambda row: -row["count"])
        counts = {kind: self.counts[kind] for kind in KINDS}
        return {"tries": self.tries, "refused": self.refused, **counts, "findings": found}


def run_trials(target: Target, seconds: float, workers: int, first: int = 0, most: int = MANY) -> Tally:
    """Run the trials of the seeds from ``first`` on, for so long and ``most`` of them.

    A process that a trial ended is followed by another.
    """
    tally = Tally()
    with tempfile.TemporaryDirectory() as name:
        seeds = [range(first + k, first + most, workers) for k in range(min(workers, most))]
        crew = [_Worker(target, Path(name) / str(k), tally, own) for k, own in enumerate(seeds)]
        begun = None
        while crew:
            crew = [worker for worker in crew if worker.watch()]
            if begun is None and all(worker.ready for worker in crew):
                begun = time.monotonic()
            if begun is not None and time.monotonic() - begun > seconds:
                for worker in crew:
                    worker.end()
            time.sleep(0.02)
    return tally


BOOK = np.dtype([(name, np.int64) for name in ("seed", "began_ns", "tries", "refused", "over")])


class _Book:
    """Numbers that a process and its watcher share."""

    def __init__(self) -> None:
        self.__dict__["_row"] = np.frombuffer(mmap.mmap(-1, BOOK.itemsize), BOOK)

    def __getattr__(self, name: str) -> int:
        return int(self.__dict__["_row"][name][0])

    def __setattr__(self, name: str, value: int) -> None:
        self.__dict__["_row"][name][0] = value


class _Worker:
    """The process that makes the trials of some seeds, and what it came to."""

    def __init__(self, target: Target, folder: Path, tally: Tally, seeds: range) -> None:
        self.target, self.folder, self.tally, self.seeds = target, folder, tally, seeds
        self.ready = False
        folder.mkdir()
        self._start()

    def _start(self) -> None:
        self.book, (self._reader, self._writer) = _Book(), os.pipe()
        os.set_blocking(self._reader, False)
        self.book.seed, self._text, self._began, self._spent = -1, b"", time.monotonic(), (-1, 0.0)
        self._process = multiprocessing.get_context("fork").Process(target=self._work, daemon=True)
        self._process.start()
        os.close(self._writer)

    def end(self) -> None:
        """Let the trial in hand be the last."""
        self.book.over = 1

    def watch(self) -> bool:
        """Look after the process; False when it has come to its end."""
        self._listen()
        self.ready = self.ready or self.book.seed >= 0
        verdict = self._verdict()
        if verdict is None and self._process.is_alive():
            return True
        if verdict is not None:
            self._kill()
        self._process.join()
        self._listen()
        os.close(self._reader)
        return self._settle(verdict)

    def _kill(self) -> None:
        """End the process; it says first where it is."""
        assert self._process.pid is not None
        os.kill(self._process.pid, signal.SIGABRT)
        self._process.join(2.0)
        self._process.kill()

    def _verdict(self) -> str | None:
        """Why the process has to go, if it has."""
        if not self.ready and time.monotonic() - self._began > PREPARING_S:
            return f"not ready within {PREPARING_S:.0f} s"
        began_ns, seed = self.book.began_ns, self.book.seed
        waited = (time.monotonic_ns() - began_ns) * 1e-9 if began_ns else 0.0
        if waited < PATIENCE_S / 5:
            return None
        if self._spent[0] != seed:
            self._spent = (seed, _processor_s(self._process.pid) - waited)
        spent = _processor_s(self._process.pid) - self._spent[1]
        return f"after {waited:.0f} s" if waited > WAITING_S or min(spent, waited) > PATIENCE_S else None

    def _settle(self, verdict: str | None) -> bool:
        """Book what the process did; True if another follows it."""
        over, seed = self.book.over, self.book.seed
        self.tally.tries += self.book.tries
        self.tally.refused += self.book.refused
        if self._process.exitcode == 0:
            return False
        kind, what = ("hang", verdict) if verdict else ("death", f"exit status {self._process.exitcode}")
        self.tally.tries += 1
        self.tally.find(seed, kind, what, _last_stack(self.folder / "stderr"))
        if seed < 0 or over:  # without a trial it would not come farther another time
            return False
        self.seeds = self.seeds[self.seeds.index(seed) + 1 :]
        self._start()
        return True

    def _listen(self) -> None:
        try:
            while piece := os.read(self._reader, 1 << 16):
                self._text += piece
        except BlockingIOError:
            pass
        *lines, self._text = self._text.split(b"\n")
        for line in lines:
            self.tally.find(*json.loads(line))

    def _work(self) -> None:
        with (self.folder / "stderr").open("w") as log:
            os.dup2(log.fileno(), 2)
            os.dup2(log.fileno(), 1)
            faulthandler.enable(log)
            place, aside = (tempfile.mkdtemp(dir=self.folder) for _ in range(2))
            tempfile.tempdir = os.environ["TMPDIR"] = aside
            attempt = self.target.prepare(Path(place))
            self._fence = Fence(Path(place), Path(aside))
            _limit_memory()
            for seed in self.seeds:
                if self.book.over:
                    break
                self._try(attempt, seed)
            log.flush()
        os._exit(0)

    def _try(self, attempt: Attempt, seed: int) -> None:
        self.book.seed, before = seed, _peak_mb()
        self.book.began_ns = time.monotonic_ns()
        kind, error = judged(attempt, seed)
        self.book.began_ns = 0
        self.book.tries += 1
        self.book.refused += kind == "refused"
        if error is not None and kind != "refused":
            self._report(seed, kind, f"{type(error).__name__}: {error}"[:300], _where(error))
        for path in self._fence.crossed():
            self._report(seed, "outside", f"{path}"[:300], "" if error is None else _where(error))
        if _peak_mb() - before > GREED_MB:
            self._report(seed, "greed", f"{_peak_mb() - before:.0f} MB", "" if error is None else _where(error))

    def _report(self, *finding: Any) -> None:
        os.write(self._writer, json.dumps(finding).encode() + b"\n")


def judged(attempt: Attempt, seed: int | random.Random) -> tuple[str, Exception | None]:
    """What one trial comes to in this process, and the exception.

    "passed", "refused", "wrong", "hang", "outside" or "bug".
    """
    draw = random.Random(seed) if isinstance(seed, int) else seed
    try:
        with np.errstate(all="ignore"):
            attempt(draw)
    except NoTrialError as error:
        return "refused", error
    except (ValueError, OSError) as error:
        return ("refused" if any(_own_frames(error)) else "bug"), error
    except (WrongAnswerError, LateError, OutsideError) as error:
        return {WrongAnswerError: "wrong", LateError: "hang", OutsideError: "outside"}[type(error)], error
    except Exception as error:
        return "bug", error
    return "passed", None


def _own_frames(error: BaseException) -> Iterator[str]:
    """The lines of the package that an exception came through, the outermost first."""
    trace = error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if PACKAGE.match(code.co_filename):
            yield f"{PACKAGE.sub('', code.co_filename)}:{trace.tb_lineno} {code.co_name}"
        trace = trace.tb_next


def _where(error: BaseException) -> str:
    """The innermost line of the package that an exception came through."""
    return next(reversed(list(_own_frames(error))), "")


def _last_stack(log: Path) -> str:
    """The innermost line of the package that is named by the log of a process that crashed."""
    lines = log.read_text(errors="replace").splitlines()
    crashed = next((k for k, line in enumerate(lines) if line.startswith("Fatal Python error")), None)
    if crashed is None:
        return "; ".join(line.strip() for line in lines[-1:])[:200]
    inside = (line for line in lines[crashed:] if PACKAGE.match(line))
    found = next(inside, lines[crashed])
    return PACKAGE.sub("", found).replace('", line ', ":").replace(" in ", " ")


def _limit_memory() -> None:
    now = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _processor_s(pid: int | None) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS
