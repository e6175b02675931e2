# SPDX-License-Identifier: Apache-2.0
"""What scripts/test runs, with tools that only take notes."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

TOOL = '#!/bin/bash\necho "$(basename "$0") $*" >> notes\n[[ "$(basename "$0")" != "$(cat fails)" ]]\n'


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A checkout whose tools all end well."""
    for name in ("scripts/bootstrap", ".venv/bin/ruff", ".venv/bin/mypy", ".venv/bin/python"):
        tool = tmp_path / name
        tool.parent.mkdir(parents=True, exist_ok=True)
        tool.write_text(TOOL)
        tool.chmod(0o755)
    shutil.copy(repository / "scripts/test", tmp_path / "scripts/test")
    (tmp_path / "fails").write_text("")
    return tmp_path


def run(checkout: Path, *words: str) -> tuple[int, list[str]]:
    """The exit status, and what was called in order; mypy and the compiling of kernels run beside each other."""
    done = subprocess.run([checkout / "scripts/test", *words])
    return done.returncode, (checkout / "notes").read_text().splitlines()


def test_two_workers_run_the_tests_and_the_arguments_are_pytests(checkout: Path) -> None:
    status, called = run(checkout, "test/cli", "-n", "0")
    assert status == 0 and called[:3] == ["bootstrap --test", "ruff check .", "ruff format --check ."]
    words = "-p no:dash --numprocesses 2 --dist loadfile --no-loadscope-reorder test/cli -n 0"
    assert called[-1] == f"python -m pytest {words}"
    assert len(called) == 6 and "mypy " in called


@pytest.mark.parametrize("tool", ["ruff", "mypy"])
def test_nothing_is_tested_where_a_tool_complains(checkout: Path, tool: str) -> None:
    (checkout / "fails").write_text(tool)
    status, called = run(checkout)
    assert status != 0 and not any("pytest" in line for line in called)


def test_with_the_versions_of_ubuntu_the_tests_alone_are_run(checkout: Path) -> None:
    shutil.copytree(checkout / ".venv", checkout / ".venv-noble")
    status, called = run(checkout, "--noble", "test/cli")
    assert status == 0 and called[0] == "bootstrap --test --noble" and called[-1].endswith("test/cli")
    assert len(called) == 3 and not any(line.startswith(("ruff", "mypy")) for line in called)
