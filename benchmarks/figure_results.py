# SPDX-License-Identifier: Apache-2.0
"""The figures of each topic as the repository keeps them: a small JSON file a topic, a folder a version."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

from figure_topics.topic import REPOSITORY, Values

from objreg_ros.whole_file import write_whole

RESULTS = REPOSITORY / "benchmarks/results"
CURRENT = RESULTS / "current"
# What figures depend on, as git names paths.
CODE = ("objreg_ros", "objreg_mapper", "objreg_tools", "models", "launch", "config", ":(exclude)*.md")


@dataclass(frozen=True)
class Result:
    """What was measured of a topic, by which code, where and when."""

    topic: str
    version: str
    commit: str
    code: str
    size: str
    command: str
    seeds: list[int]
    date: str
    machine: str
    cores: int
    load: float
    seconds: float
    processor_seconds: float
    figures: dict[str, Values]

    def write(self, folder: Path = CURRENT) -> None:
        """Write it whole, in the others' stead."""
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / f"{self.topic}.json", json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n")


def read_result(topic: str, folder: Path = CURRENT) -> Result | None:
    """What is kept of a topic; None where nothing is."""
    file = folder / f"{topic}.json"
    return Result(**json.loads(file.read_text(encoding="utf-8"))) if file.exists() else None


def version() -> str:
    """The version that setup.py states."""
    found = re.search(r'version="([^"]+)"', (REPOSITORY / "setup.py").read_text(encoding="utf-8"))
    assert found is not None
    return found[1]


def commit() -> str:
    """The commit that is checked out, ``-dirty`` where its code has been changed since."""
    is_dirty = bool(_git("status", "--porcelain", "--", *CODE))
    return _git("rev-parse", "--short", "HEAD") + ("-dirty" if is_dirty else "")


def code_of() -> str:
    """A name of the code that figures depend on, whatever is committed; another one after each change of it."""
    tracked = _git("ls-files", "--stage", "--", *CODE) + _git("diff", "HEAD", "--", *CODE)
    return hashlib.sha256(tracked.encode()).hexdigest()[:12]


def machine() -> str:
    """The processor's name."""
    info = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*: (.+)$", info, re.MULTILINE)
    return model[1].strip() if model else os.uname().machine


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=REPOSITORY, check=True, capture_output=True, text=True
    ).stdout.strip()
