# SPDX-License-Identifier: Apache-2.0
"""What figures are said to be of: the code that they depend on, by one name."""

from __future__ import annotations

import importlib
import subprocess
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("changed", "is_other"),
    [("objreg_ros/node.py", True), ("models/one.onnx", True), ("models/README.md", False), ("docs/page.py", False)],
)
def test_the_code_has_another_name_after_each_change_but_of_documents(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str, is_other: bool
) -> None:
    results = importlib.import_module("figure_results")
    monkeypatch.setattr(results, "REPOSITORY", tmp_path)
    files = [tmp_path / name for name in ("objreg_ros/node.py", "models/one.onnx", "models/README.md", "docs/page.py")]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        file.write_text("first\n")

    def git(*arguments: str) -> None:
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments], cwd=tmp_path, check=True)

    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "first")
    first = results.code_of()
    (tmp_path / changed).write_text("second\n")
    assert (results.code_of() != first) == is_other
    assert results.commit().endswith("-dirty") == is_other
    git("commit", "-qam", "second")
    assert (results.code_of() != first) == is_other
