# SPDX-License-Identifier: Apache-2.0
"""Robots live: when a run is over, and how it is started."""

from __future__ import annotations

import importlib
import signal
import sys
import time
from pathlib import Path
from types import ModuleType

import click
import pytest
from click.testing import CliRunner


@pytest.fixture
def team() -> ModuleType:
    pytest.importorskip("rclpy", reason="the benchmark runs nodes of ROS 2")
    return importlib.import_module("team")


def test_a_run_is_over_when_every_keyframe_of_every_frame_was_searched_for(team: ModuleType) -> None:
    keyframer = {"received": "9", "waiting": "0", "keyframes sent": "2"}
    status = {"r1/keyframer": keyframer, "registrar": {"received": "2", "waiting": "0"}}
    assert team.is_settled(status, {"r1": 9})
    assert not team.is_settled(status, {"r1": 10})
    assert not team.is_settled({**status, "registrar": {"received": "1", "waiting": "0"}}, {"r1": 9})
    assert not team.is_settled({**status, "registrar": {"received": "2", "waiting": "1"}}, {"r1": 9})
    assert not team.is_settled({**status, "r1/keyframer": {**keyframer, "waiting": "1"}}, {"r1": 9})


def test_trouble_is_a_loss_and_a_pause(team: ModuleType) -> None:
    assert team.trouble_of("0.2:30").name == "hosts, 20% lost, pause of 30 s"
    assert team.trouble_of("0").name == "hosts, 0% lost"
    with pytest.raises(click.BadParameter, match="expected LOSS:PAUSE"):
        team.trouble_of("bad")


def test_robots_are_of_a_folder_or_simulated(team: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(team, "simulated", lambda seed, frames, keep: Path(keep, f"{seed}_{frames}"))
    assert team.recordings(tmp_path, None, 60, Path("kept")) == tmp_path
    assert team.recordings(None, 1, 60, Path("kept")) == Path("kept/1_60")
    assert team.recordings(None, 1, None, Path("kept")) == Path("kept/1_500")
    for folder, seed, got in ((None, None, "neither"), (tmp_path, 1, "both")):
        with pytest.raises(click.UsageError, match=f"expected FOLDER or --simulate SEED, got {got}"):
            team.recordings(folder, seed, None, Path("kept"))


def test_hosts_without_root_are_refused_in_one_line(
    team: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    result = CliRunner().invoke(team.main, [str(tmp_path), "--trouble", "0:0"])
    assert result.exit_code == 1 and "expected to run as root" in result.output


@pytest.mark.skipif(sys.platform != "linux", reason="processes die with the script on Linux only")
def test_what_was_started_here_ends_with_the_run(team: ModuleType) -> None:
    with team.Here() as here:
        started = time.monotonic()
        process = here.start(0, ["sleep", "60"], {})
    assert process.returncode == -signal.SIGKILL and time.monotonic() - started < 10.0
