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
  "-V "*) echo Python ${PYTHON_VERSION:-3.12.0} ;;
  "-c import rclpy") [[ -n "${ROS_DISTRO:-}" ]] ;;
  "-m pip") shift 6; echo "$*" >> "$NOTES" ;;
esac
"""
BUILD = "--require-hashes --requirement requirements/build.lock"
LOCKED = "--require-hashes --no-build-isolation --requirement requirements/python3.12.lock"
TESTING = f"{LOCKED} --requirement requirements/python3.12-test.lock"
ITSELF = "--no-build-isolation --no-deps --editable ."


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """A checkout whose environment is there and empty."""
    for name in ("scripts/bootstrap", "setup.py", "config/constraints.txt", *locks(repository)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(repository / name, tmp_path / name)
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTHON)
    python.chmod(0o755)
    uname = tmp_path / "bin" / "uname"
    uname.parent.mkdir()
    uname.write_text("#!/bin/bash\nset -- $1 ${SYSTEM:-Linux x86_64}\n[[ $1 == -m ]] && echo $3 || echo $2 $3\n")
    uname.chmod(0o755)
    return tmp_path


def locks(repository: Path) -> list[str]:
    return [str(path.relative_to(repository)) for path in (repository / "requirements").glob("*.lock")]


def bootstrap(checkout: Path, *words: str, **variables: str) -> list[str]:
    """What pip is asked to install."""
    return received(checkout, *words, **variables)[0]


def received(checkout: Path, *words: str, **variables: str) -> tuple[list[str], str]:
    """What pip is asked to install, and what the script says."""
    notes = checkout / "notes"
    notes.write_text("")
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DISTRO"}
    environment |= {"PYTHON": str(checkout / ".venv/bin/python"), "NOTES": str(notes)}
    environment |= {"PATH": f"{checkout / 'bin'}:{os.environ['PATH']}", **variables}
    said = subprocess.run(
        [checkout / "scripts/bootstrap", *words], env=environment, check=True, capture_output=True, text=True
    )
    return notes.read_text().splitlines(), said.stderr


def test_what_is_there_is_not_installed_again(checkout: Path) -> None:
    assert bootstrap(checkout) == [BUILD, LOCKED, ITSELF]
    assert bootstrap(checkout) == []
    assert bootstrap(checkout, "--test") == [BUILD, TESTING, ITSELF]
    assert bootstrap(checkout, "--test") == bootstrap(checkout) == []


@pytest.mark.parametrize("changed", ["setup.py", "requirements/python3.12.lock"])
def test_what_another_setup_or_lock_asked_for_is_not_taken_as_installed(checkout: Path, changed: str) -> None:
    bootstrap(checkout, "--test")
    (checkout / changed).write_text("# it asks for more now\n")
    assert bootstrap(checkout) == [BUILD, LOCKED, ITSELF]
    assert bootstrap(checkout, "--test") == [BUILD, TESTING, ITSELF]


@pytest.mark.parametrize(
    ("variables", "wanted", "reason"),
    [
        (
            {"PYTHON_VERSION": "3.13.0"},
            "--editable .[tools,paper,mapper,report,batch,metrics,ros]",
            "no lock fits Python 3.13.0 on Linux x86_64",
        ),
        (
            {"SYSTEM": "Linux aarch64", "ROS_DISTRO": "jazzy"},
            "--editable .[tools,paper,mapper,report,batch,metrics] --constraint config/constraints.txt",
            "no lock fits Python 3.12.0 beside a sourced ROS",
        ),
        (
            {"ROS_DISTRO": "jazzy"},
            "--editable .[tools,paper,mapper,report,batch,metrics] --constraint config/constraints.txt",
            "no lock fits Python 3.12.0 beside a sourced ROS",
        ),
    ],
)
def test_where_no_lock_fits_pip_chooses_and_the_script_says_so(
    checkout: Path, variables: dict[str, str], wanted: str, reason: str
) -> None:
    asked, said = received(checkout, **variables)
    assert asked == [wanted] and reason in said


def test_on_an_arm_without_a_sourced_ros_it_says_what_to_do(checkout: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError) as failed:
        bootstrap(checkout, SYSTEM="Linux aarch64")
    assert "expected a sourced ROS 2 Jazzy on aarch64, got none" in failed.value.stderr
    assert "ros-jazzy-ros-base" in failed.value.stderr and not (checkout / "notes").read_text()


OBJREG = """#!/bin/bash
[[ "$_OBJREG_COMPLETE" == *_source ]] && echo "# of ${_OBJREG_COMPLETE%_source}"
"""


def test_completion_is_installed_and_the_environment_sources_it_once(checkout: Path) -> None:
    objreg, activate = checkout / ".venv/bin/objreg", checkout / ".venv/bin/activate"
    objreg.write_text(OBJREG)
    objreg.chmod(0o755)
    for script in ("activate", "activate.fish"):
        (checkout / ".venv/bin" / script).write_text("# of venv\n")
    for change in ("", "# it asks for more now\n"):
        (checkout / "setup.py").write_text(change)
        bootstrap(checkout)
    environment = checkout / ".venv/share"
    assert (environment / "bash-completion/completions/objreg").read_text() == "# of bash\n"
    assert (environment / "zsh/site-functions/_objreg").read_text() == "# of zsh\n"
    assert (environment / "fish/vendor_completions.d/objreg.fish").read_text() == "# of fish\n"
    for script in ("activate", "activate.fish"):
        assert (checkout / ".venv/bin" / script).read_text().count("# objreg: completion") == 1
    (environment / "bash-completion/completions/objreg").write_text("echo completes\n")
    for shell, printed in (("bash", "completes\n"), ("sh", "")):
        sourced = f"set -eu; VIRTUAL_ENV={checkout / '.venv'}; . {activate}"
        assert subprocess.run([shell, "-c", sourced], check=True, capture_output=True, text=True).stdout == printed


def test_what_cannot_complete_is_no_obstacle(checkout: Path) -> None:
    objreg = checkout / ".venv/bin/objreg"
    objreg.write_text("#!/bin/bash\nexit 1\n")
    objreg.chmod(0o755)
    asked, said = received(checkout)
    assert asked and "objreg works without" in said


def test_the_versions_of_ubuntu_go_into_an_environment_of_their_own(checkout: Path) -> None:
    shutil.copytree(checkout / ".venv", checkout / ".venv-noble")
    noble = "--require-hashes --no-build-isolation --no-deps --requirement requirements/noble.lock"
    assert bootstrap(checkout, "--test", "--noble") == [BUILD, noble, ITSELF]
    assert bootstrap(checkout, "--test", "--noble") == []
    assert bootstrap(checkout) == [BUILD, LOCKED, ITSELF]
