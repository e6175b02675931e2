# SPDX-License-Identifier: Apache-2.0
"""The process of the command: signals, pipes and disks end it without a traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

OBJREG = [sys.executable, "-m", "objreg_tools"]
SIGNALLED = (128 + signal.SIGINT, -signal.SIGINT)  # given by the command, or by the system before it
IN_IMPORT = """
import signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            signal.raise_signal(signal.SIGINT)

module = sys.argv.pop(1)
sys.meta_path.insert(0, Interrupting())
from objreg_tools.__main__ import main
main()
"""
BEGUN = """
import signal, sys

signal.signal(signal.SIGINT, signal.SIG_DFL)
print("begun", flush=True)
from objreg_tools.__main__ import main
main()
"""
SWALLOWED = """
import signal, time, weakref
from objreg_tools import cli
from objreg_tools.__main__ import main

class Kept:
    pass

def work(**_):
    one = Kept()
    kept = weakref.ref(one, lambda _: signal.raise_signal(signal.SIGINT))
    del one  # what a callback raises goes nowhere
    time.sleep(20)

cli.group.main = work
main()
"""

MISTAKEN = """
import signal
from objreg_tools import cli
from objreg_tools.__main__ import main

def work(**_):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        {end}

cli.group.main = work
main()
"""


def ended(command: list[str]) -> tuple[int, str]:
    """The status of a command and what it says as it ends."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("module", ["click", "objreg_tools.cli.commands.inspect", "numpy", "cv2", "rosbags.interfaces"])
def test_an_interrupt_during_an_import_says_nothing(module: str, tmp_path: Path) -> None:
    status, said = ended([sys.executable, "-c", IN_IMPORT, module, "inspect", str(tmp_path)])
    assert status in SIGNALLED and not said.strip()


def test_an_interrupt_that_is_swallowed_comes_again() -> None:
    began = time.monotonic()
    status, said = ended([sys.executable, "-c", SWALLOWED])
    assert status in SIGNALLED and not said.strip() and time.monotonic() - began < 15


@pytest.mark.parametrize("end", ["return 1", "raise SystemExit(1)"])
def test_an_interrupt_that_a_library_made_an_error_of_ends_the_command(end: str) -> None:
    status, said = ended([sys.executable, "-c", MISTAKEN.format(end=end)])
    assert status in SIGNALLED and not said.strip()


@pytest.mark.parametrize("delay_s", [0.3, 0.9, 1.5])
def test_an_interrupt_at_any_moment_says_nothing(delay_s: float) -> None:
    doctor = [sys.executable, "-c", BEGUN, "doctor"]
    with subprocess.Popen(doctor, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "begun\n"  # Python's own start is not ours
        time.sleep(delay_s)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
    assert process.returncode in (0, *SIGNALLED), said
    assert "Traceback" not in said and "ignored" not in said


def test_an_interrupt_that_is_ignored_from_outside_stays_so(tmp_path: Path) -> None:
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN);" + IN_IMPORT
    status, said = ended([sys.executable, "-c", code, "numpy", "inspect", str(tmp_path / "nowhere")])
    assert status == 1 and "no such file" in said


def test_a_reader_who_leaves_ends_the_command_silently() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as closed:
        done = subprocess.run([*OBJREG, "params"], stdout=closed, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (141, "")


def test_an_output_that_is_full_is_one_line() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([*OBJREG, "params"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("objreg: standard output: expected a place that takes it, got: No space left")


def test_the_version_is_that_of_the_package(repository: Path) -> None:
    output = subprocess.run([*OBJREG, "--version"], capture_output=True, text=True, check=True).stdout
    assert f"<version>{output.split()[1]}</version>" in (repository / "package.xml").read_text()
