# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from objreg_tools.cli.processes import Processes

SLEEPER = "import time\nprint('ready', flush=True)\ntime.sleep(60)\n"
FAILURE = "import sys\nprint('so far so good')\nsys.exit('this went wrong')\n"


@pytest.fixture
def modules(tmp_path: Path) -> dict[str, str]:
    """An environment in which the modules ``sleeper`` and ``failure`` can be run."""
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    (tmp_path / "failure.py").write_text(FAILURE)
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def test_every_process_has_ended_when_the_block_is_left_by_an_error(tmp_path: Path, modules: dict[str, str]) -> None:
    with pytest.raises(RuntimeError), Processes(tmp_path / "logs", modules) as processes:
        sleepers = [processes.start(name, "sleeper", ()) for name in ("a", "b")]
        raise RuntimeError
    assert all(sleeper.poll() is not None for sleeper in sleepers)


def test_a_failed_process_is_reported_with_its_last_words(tmp_path: Path, modules: dict[str, str]) -> None:
    with Processes(tmp_path / "logs", modules) as processes:
        processes.start("good", "sleeper", ())
        processes.start("bad", "failure", ()).wait(60)
        with pytest.raises(ValueError, match="bad ended with status 1; its last line: this went wrong"):
            processes.require_alive()


def test_what_a_process_says_is_in_its_log(tmp_path: Path, modules: dict[str, str]) -> None:
    with Processes(tmp_path / "logs", modules) as processes:
        processes.start("a", "sleeper", ())
        deadline = time.monotonic() + 60
        while "ready" not in processes.log("a").read_text() and time.monotonic() < deadline:
            time.sleep(0.05)
        processes.require_alive()
    assert processes.log("a").read_text().startswith("ready")
