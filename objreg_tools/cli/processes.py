# SPDX-License-Identifier: Apache-2.0
"""Child processes that never outlive their parent's work."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

GRACE_S = 15.0  # seconds that a node has to end by itself


class Processes:
    """A context manager: whatever happens inside, every process has ended when it is left. Output goes to log files."""

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        self._folder = folder
        self._environment = {**environment, "PYTHONUNBUFFERED": "1"}  # so that its last line is the last
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._running.values():
            process.send_signal(signal.SIGINT)
        for process in self._running.values():
            try:
                process.wait(GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(self, name: str, module: str, arguments: Sequence[str], quiet: bool = True) -> subprocess.Popen[bytes]:
        """Run ``python -m module arguments``; a ``quiet`` one writes to its log file and not to the terminal."""
        command = [sys.executable, "-m", module, *arguments]
        with self.log(name).open("wb") as log:
            out = log if quiet else None
            self._running[name] = subprocess.Popen(command, env=self._environment, stdout=log, stderr=out)
        return self._running[name]

    def log(self, name: str) -> Path:
        """The file that a process writes to."""
        return self._folder / f"{name}.log"

    def require_alive(self) -> None:
        """ValueError with the last line of a process that has failed."""
        for name, process in self._running.items():
            if process.poll():
                lines = self.log(name).read_text(errors="replace").strip().splitlines() or ["nothing"]
                raise ValueError(f"{name} ended with status {process.returncode}; its last line: {lines[-1]}")
