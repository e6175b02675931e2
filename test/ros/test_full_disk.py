# SPDX-License-Identifier: Apache-2.0
"""A registrar whose disk is full says so, goes on, and keeps what it had; one that is read-only ends the start."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from std_msgs.msg import Header

from objreg_ros.memory.store import Store

from .graph import START_S, Graph
from .test_relocalised import BESIDE, HERE, MOUNT, frame, send_frame

pytestmark = [pytest.mark.ros, pytest.mark.skipif(os.getuid() != 0, reason="only root may mount a small disk")]
SIZE = "1M"  # of a keyframe or two


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of `SIZE`."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", place], capture_output=True)
    if mounted.returncode:
        pytest.skip(f"no disk can be mounted here: {mounted.stderr.decode().strip()}")
    yield place
    subprocess.run(["umount", "--lazy", place], check=True)


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def feed(graph: Graph, first: int, count: int) -> list[str]:
    """What becomes of frames of which each ends the keyframe before it."""
    answers = []
    for k in range(first, first + count):
        seen = frame(10 + 3 * k, *((HERE, HERE) if k % 2 else (BESIDE, BESIDE)))
        send_frame(graph, seen, dict(enumerate(sorted({cloud.label for cloud in seen.objects}))))
        answers.append(graph.answer("registrar", seen.stamp_ns))
    return answers


def ids(store: Path) -> list[int]:
    with closing(Store(store, read_only=True)) as opened:
        return opened.keyframe_ids()


def test_a_full_disk_is_named_keeps_what_is_stored_and_ends_nothing(fresh: Graph, disk: Path) -> None:
    store = disk / "place.db"
    fresh.receive(Header, "finished")
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", MOUNT)
    answers = feed(fresh, 0, 14)
    assert "dropped refused" in answers and fresh.alive("registrar")
    before = ids(store)
    assert before, "the disk held no keyframe at all"
    fresh.wait_for(lambda: "place.db" in fresh.log("registrar"), START_S, "a line about the store")
    assert "full" in fresh.log("registrar")
    subprocess.run(["mount", "-o", "remount,size=64M", disk], check=True)
    assert "published" in feed(fresh, 14, 4)
    assert fresh.stop("registrar") == 0
    assert set(before) < set(ids(store))


def test_a_store_on_a_disk_that_is_read_only_is_refused_at_the_start(fresh: Graph, disk: Path) -> None:
    store = disk / "place.db"
    Store(store).close()
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    done = subprocess.run(
        fresh.command("registrar", f"-p store:={store}"), env=fresh.environment(), capture_output=True, text=True,
        timeout=START_S,
    )  # fmt: skip
    last = done.stderr.strip().splitlines()[-1]
    assert done.returncode == 1 and "place.db" in last and "Read-only file system" in last, done.stderr
