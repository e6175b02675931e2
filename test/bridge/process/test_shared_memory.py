# SPDX-License-Identifier: Apache-2.0
"""Tests of the shared memory that killed nodes leave."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from objreg_ros.bridge.process.shared_memory import FOLDER, SEGMENT, abandoned, free_abandoned

NAME = "fastrtps_0123456789abcdef"


def leave(folder: Path, name: str, size: int = 1000) -> Path:
    """A segment of a process that is gone."""
    path = folder / name
    path.write_bytes(bytes(size))
    path.with_name(f"{name}_el").touch()
    return path


def test_what_no_process_holds_is_freed_with_the_file_of_its_lock(tmp_path: Path) -> None:
    path = leave(tmp_path, NAME)
    assert abandoned(tmp_path, 0.0) == {path: 1000}
    assert free_abandoned(tmp_path, 0.0) == 1000
    assert list(tmp_path.iterdir()) == []


def test_what_a_process_holds_stays(tmp_path: Path) -> None:
    path = leave(tmp_path, NAME)
    with path.with_name(f"{NAME}_el").open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert free_abandoned(tmp_path, 0.0) == 0
    assert path.exists()


def test_what_was_made_just_now_stays_for_its_process_may_not_hold_it_yet(tmp_path: Path) -> None:
    path = leave(tmp_path, NAME)
    assert free_abandoned(tmp_path) == 0 and path.exists()
    os.utime(path, (0, 0))
    assert free_abandoned(tmp_path) == 1000


@pytest.mark.parametrize("name", ["fastrtps_port7001", "sem.fastrtps_port7001_mutex", "mine", f"{NAME}.txt"])
def test_what_is_not_a_segment_stays(tmp_path: Path, name: str) -> None:
    path = leave(tmp_path, name)
    assert free_abandoned(tmp_path, 0.0) == 0 and path.exists()


def test_a_segment_without_the_file_of_its_lock_stays(tmp_path: Path) -> None:
    (tmp_path / NAME).touch()
    assert free_abandoned(tmp_path, 0.0) == 0 and (tmp_path / NAME).exists()


def test_a_folder_that_is_not_there_holds_none(tmp_path: Path) -> None:
    assert abandoned(tmp_path / "none") == {} and free_abandoned(tmp_path / "none") == 0


LIVING = """
import os, sys
import rclpy
rclpy.init()
node = rclpy.create_node("holder_of_a_segment")
held = {line.split("/")[-1].strip() for line in open("/proc/self/maps") if "/dev/shm/fastrtps_" in line}
print(*held, flush=True)
sys.stdin.read()
"""


def test_the_segment_of_a_living_node_of_fast_dds_stays_and_that_of_a_killed_one_is_found(domain: int) -> None:
    pytest.importorskip("rmw_fastrtps_cpp", reason="its segments are Fast DDS's")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
    command = [sys.executable, "-c", LIVING]
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        own = {FOLDER / name for name in process.stdout.readline().split() if SEGMENT.fullmatch(name)}
        assert own and not own & abandoned(least_age_s=0.0).keys()
        process.kill()
        process.wait()
    assert own & abandoned(least_age_s=0.0).keys()
