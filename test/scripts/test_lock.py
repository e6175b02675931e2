# SPDX-License-Identifier: Apache-2.0
"""The locks that scripts/lock has made hold all that setup.py asks for, by version and hash."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

HASHES = r"(?: \\\n    --hash=sha256:[0-9a-f]{64})+"
PIN = re.compile(rf"^(?P<name>[a-z0-9.-]+)==(?P<version>\S+){HASHES}$", re.MULTILINE)
PYTHONS = ("3.11", "3.12")
# The extras that scripts/bootstrap installs where there is no ROS.
RUN = ("ros", "tools", "paper", "mapper", "report", "batch", "metrics")
TEST = ("test", "docs")  # those that it adds with --test


def pins(repository: Path, name: str) -> dict[str, str]:
    """The version of every package of a lock; a line that is neither a pin with hashes nor a comment fails."""
    text = (repository / "requirements" / f"{name}.lock").read_text()
    left = [line for line in PIN.sub("", text).splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert not left, f"{name}.lock: expected pins with hashes, got {left[:3]}"
    return {pin["name"]: pin["version"] for pin in PIN.finditer(text)}


def wanted(repository: Path, *extras: str) -> dict[str, str]:
    """What setup.py asks for, each with its oldest version."""
    asked = {
        node.arg: ast.literal_eval(node.value)
        for node in ast.walk(ast.parse((repository / "setup.py").read_text()))
        if isinstance(node, ast.keyword) and node.arg in ("install_requires", "extras_require")
    }
    lines = [*asked["install_requires"], *(line for extra in extras for line in asked["extras_require"][extra])]
    return {name.replace("_", "-"): oldest for name, _, oldest in (line.partition(">=") for line in lines)}


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version))


@pytest.mark.parametrize("python", PYTHONS)
def test_a_lock_has_a_version_of_all_that_setup_py_asks_for_and_none_too_old(repository: Path, python: str) -> None:
    run = pins(repository, f"python{python}")
    every = {**run, **pins(repository, f"python{python}-test")}
    for locked, asked in ((run, wanted(repository, *RUN)), (every, wanted(repository, *RUN, *TEST))):
        assert set(asked) <= set(locked), f"run scripts/lock: python{python} lacks {set(asked) - set(locked)}"
        assert not {name for name, oldest in asked.items() if numbers(locked[name]) < numbers(oldest)}


@pytest.mark.parametrize("python", PYTHONS)
def test_the_lock_for_tests_adds_to_the_other_and_repeats_nothing(repository: Path, python: str) -> None:
    assert not set(pins(repository, f"python{python}")) & set(pins(repository, f"python{python}-test"))


@pytest.mark.parametrize("python", PYTHONS)
def test_what_is_built_here_is_built_with_the_setuptools_of_the_lock(repository: Path, python: str) -> None:
    assert pins(repository, "build") == {"setuptools": pins(repository, f"python{python}")["setuptools"]}


def test_ubuntus_python_has_the_numpy_that_jazzys_packages_are_built_for(repository: Path) -> None:
    assert pins(repository, "python3.12")["numpy"].startswith("1.26.")


def test_training_is_not_locked(repository: Path) -> None:
    assert not any("torch" in pins(repository, path.stem) for path in (repository / "requirements").glob("*.lock"))
