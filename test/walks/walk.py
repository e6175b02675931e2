# SPDX-License-Identifier: Apache-2.0
"""A user at a terminal, who types a command and goes on with what it says."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
ROOM = ("--scenario", "loop", "--seed", "1", "--frames", "60", "--size", "320x240")
PATIENCE_S = 600.0  # on a machine that may be busy


@dataclass(frozen=True, slots=True)
class Said:
    """What a command said in all, and on standard output alone."""

    text: str
    output: str

    def advice(self) -> list[str]:
        """What the lines that begin with ``next:`` say; AssertionError where there is none, which is a dead end."""
        advice = re.findall(r"^ *next: (.+)$", self.text, re.MULTILINE)
        assert advice, f"a dead end:\n{self.text}"
        return advice

    def command(self) -> list[str]:
        """The last advice, which is a command, as the words behind `objreg`."""
        words = shlex.split(self.advice()[-1])
        assert words[0] == "objreg", f"expected a command, got: {self.advice()[-1]}"
        return words[1:]

    def advises(self, words: str) -> bool:
        """Whether some advice contains the words."""
        return any(words in line for line in self.advice())

    def leads_to(self, repository: Path = REPOSITORY) -> set[str]:
        """The sections of the troubleshooting page that are named; AssertionError where the page has no such one."""
        page = (repository / "docs/troubleshooting.md").read_text(encoding="utf-8").lower()
        headings = {re.sub(r"[^\w\- ]", "", line).replace(" ", "-") for line in re.findall(r"^#+ (.+)$", page, re.M)}
        named = set(re.findall(r"troubleshooting\.md#([\w-]+)", self.text))
        assert named <= headings, f"no sections: {named - headings}"
        return named


@dataclass(frozen=True, slots=True)
class Walk:
    """Commands that are typed one after another in ``folder``."""

    folder: Path

    def type(self, *words: str, ends: int = 0) -> Said:
        """Run `objreg` with these words; AssertionError where it ends otherwise, or with a traceback."""
        command = [sys.executable, "-m", "objreg_tools.cli", *words]
        path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
        environment = {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        text = done.stdout + done.stderr
        assert done.returncode == ends, f"{shlex.join(words)}: {done.returncode} in place of {ends}\n{text}"
        assert "Traceback" not in text, text
        return Said(text, done.stdout)

    def follow(self, said: Said, *more: str, ends: int = 0) -> Said:
        """Type the command that was advised, with ``more`` behind it."""
        return self.type(*said.command(), *more, ends=ends)
