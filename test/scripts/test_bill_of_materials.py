# SPDX-License-Identifier: Apache-2.0
"""What scripts/bill_of_materials installs and writes, with tools that only take notes."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PYTHON = """#!/bin/bash
echo "python $*" >> "$NOTES"
case "$1 $2" in
  "-m venv") mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; cp "$CYCLONEDX" "$3/bin/cyclonedx-py" ;;
  "-m pip") exit "${PIP_STATUS:-0}" ;;
esac
"""
CYCLONEDX = """#!/bin/bash
echo "cyclonedx-py $*" >> "$NOTES"
while [[ "$1" != --output-file ]]; do shift; done
echo '{"bomFormat": "CycloneDX"}' > "$2"
"""


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A checkout with an environment."""
    for name, text in {".venv/bin/python": PYTHON, "cyclonedx-py": CYCLONEDX}.items():
        tool = tmp_path / "checkout" / name
        tool.parent.mkdir(parents=True, exist_ok=True)
        tool.write_text(text)
        tool.chmod(0o755)
    (tmp_path / "checkout/scripts").mkdir()
    shutil.copy(repository / "scripts/bill_of_materials", tmp_path / "checkout/scripts")
    return tmp_path / "checkout"


def run(checkout: Path, *words: str, **variables: str) -> tuple[subprocess.CompletedProcess[str], list[str]]:
    """What came of it, called from the folder around the checkout, and what was called."""
    notes = checkout / "notes"
    notes.write_text("")
    passing = checkout / "passing"
    passing.mkdir(exist_ok=True)
    done = subprocess.run(
        [checkout / "scripts/bill_of_materials", *words], cwd=checkout.parent, capture_output=True, text=True,
        env={**os.environ, "NOTES": str(notes), "CYCLONEDX": str(checkout / "cyclonedx-py"),
             "TMPDIR": str(passing), **variables},
    )  # fmt: skip
    assert not list(passing.iterdir())  # the tool goes as it ends
    return done, notes.read_text().splitlines()


def test_the_tool_comes_by_its_hash_and_looks_at_the_environment_of_the_checkout(checkout: Path) -> None:
    done, called = run(checkout, "out.json")
    assert done.returncode == 0, done.stderr
    assert called[1].endswith("--require-hashes --requirement requirements/tools.lock")
    assert called[2].startswith("cyclonedx-py environment") and called[2].endswith(" .venv/bin/python")
    assert "CycloneDX" in (checkout.parent / "out.json").read_text()  # a path is from where it is called


@pytest.mark.parametrize("lacking", ["environment", "network"])
def test_what_is_lacking_is_named_and_nothing_is_written(checkout: Path, lacking: str) -> None:
    if lacking == "environment":
        shutil.rmtree(checkout / ".venv")
    done, _ = run(checkout, "out.json", PIP_STATUS="1")
    said = {"environment": "run scripts/bootstrap first", "network": "pip could not install the tool"}
    assert done.returncode == 1 and said[lacking] in done.stderr
    assert not (checkout.parent / "out.json").exists()
