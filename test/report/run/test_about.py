# SPDX-License-Identifier: Apache-2.0
"""Who reads a report can make its run again."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
from pathlib import Path

import pytest

from objreg_tools.report.run.about import about, commit, version


def test_a_run_states_what_it_was_made_with(tmp_path: Path) -> None:
    (tmp_path / "cups.onnx").write_bytes(b"weights")
    made = about(
        tmp_path, str(tmp_path / "cups.onnx"), {"detector.threshold": 0.4}, ["offline", "my room", "--json", "x"]
    )
    assert made["command"] == "objreg offline 'my room' --json x" and made["recording"] == str(tmp_path)
    digest = hashlib.sha256(b"weights").hexdigest()
    assert made["model"] == {"name": "cups.onnx", "sha256": digest[:12], "threshold": 0.4}
    assert about(tmp_path, str(tmp_path / "cups.onnx"), {}, [])["model"]["threshold"] == 0.5
    assert made["params"] == {"detector.threshold": 0.4} and json.loads(json.dumps(made)) == made
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", made["date"])


def test_the_version_is_that_of_the_package() -> None:
    packaged = Path(__file__).resolve().parents[3] / "package.xml"
    assert f"<version>{version()}</version>" in packaged.read_text()


def git(folder: Path, *arguments: str) -> str:
    asked = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
    return subprocess.run(asked, check=True, capture_output=True, text=True).stdout


def test_the_commit_of_a_checkout_says_where_files_differ_from_it(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    (tmp_path / "a").write_text("1")
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "-qm", "one")
    head = git(tmp_path, "rev-parse", "HEAD").strip()
    assert commit(tmp_path) == head[:12]
    (tmp_path / "a").write_text("2")
    assert commit(tmp_path) == f"{head[:12]}-dirty"


def test_there_is_no_commit_without_a_checkout_or_git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert commit(None) is None and commit(tmp_path) is None
    (tmp_path / ".git").mkdir()
    assert commit(tmp_path) is None, "an empty .git is no repository"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert commit(tmp_path) is None, "without git"
