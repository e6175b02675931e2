# SPDX-License-Identifier: Apache-2.0
"""A commit's subject begins with a folder or file and has at most 60 characters."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A repository of two files, the script among them, with one commit."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(repository / "scripts/check_commits", tmp_path / "scripts")
    (tmp_path / "gate.py").touch()
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    commit(tmp_path, "anything at all")
    return tmp_path


def git(folder: Path, *arguments: str) -> None:
    subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)


def commit(folder: Path, subject: str) -> None:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.invalid")
    git(folder, *who, "commit", "-q", "--allow-empty", "-m", subject)


def checked(folder: Path) -> tuple[int, str]:
    done = subprocess.run(["scripts/check_commits", "HEAD~1.."], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stderr


def test_a_subject_that_begins_with_a_file_or_a_folder_passes(checkout: Path) -> None:
    for subject in ("gate: refuse a pose without evidence", "scripts: check subjects"):
        commit(checkout, subject)
        assert checked(checkout) == (0, "")


@pytest.mark.parametrize("subject", ["refuse a pose", "nowhere: refuse a pose", f"gate: {'x' * 60}"])
def test_another_subject_is_named(checkout: Path, subject: str) -> None:
    commit(checkout, subject)
    status, problem = checked(checkout)
    assert status == 1 and subject in problem
