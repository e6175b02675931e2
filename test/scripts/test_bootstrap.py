# SPDX-License-Identifier: Apache-2.0
"""What scripts/bootstrap installs, with a Python that only takes notes."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PYTHON = """#!/bin/bash
case "$1 $2" in
  "-V "*) echo Python 3.12.0 ;;
  "-c import rclpy") exit 1 ;;
  "-m pip") echo "${@: -1}" >> "$NOTES" ;;
esac
"""


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A checkout whose environment is there and empty."""
    for name in ("scripts/bootstrap", "setup.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(repository / name, tmp_path / name)
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTHON)
    python.chmod(0o755)
    return tmp_path


def bootstrap(checkout: Path, *words: str) -> list[str]:
    """What pip is asked to install."""
    notes = checkout / "notes"
    notes.write_text("")
    environment = {**os.environ, "PYTHON": str(checkout / ".venv/bin/python"), "NOTES": str(notes)}
    subprocess.run([checkout / "scripts/bootstrap", *words], env=environment, check=True, capture_output=True)
    return notes.read_text().split()


def test_what_is_there_is_not_installed_again(checkout: Path) -> None:
    assert bootstrap(checkout) == [".[ros]"]
    assert bootstrap(checkout) == []
    assert bootstrap(checkout, "--test") == [".[test,ros]"]
    assert bootstrap(checkout, "--test") == bootstrap(checkout) == []


def test_what_another_setup_asked_for_is_not_taken_as_installed(checkout: Path) -> None:
    bootstrap(checkout, "--test")
    (checkout / "setup.py").write_text("# it asks for more now\n")
    assert bootstrap(checkout) == [".[ros]"]
    assert bootstrap(checkout, "--test") == [".[test,ros]"]
