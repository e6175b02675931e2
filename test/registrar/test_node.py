# SPDX-License-Identifier: Apache-2.0
"""The door of the registrar where keyframes wait, cameras change and its store does not let it."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import rclpy
from std_srvs.srv import Trigger

from objreg_ros.registrar.keyframes import Stretch
from objreg_ros.registrar.node import RegistrarNode
from objreg_ros.registrar.registrar import Outcome
from objreg_ros.registrar.store import Store

from .samples import SECOND, box, frame

CUP = (box("cup", (0, 0, 1)),)
Making = Callable[[], RegistrarNode]


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Making]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.setattr("objreg_ros.registrar.node.warm", lambda params: None)
    rclpy.init(args=["registrar", "--ros-args", "-p", f"store:={tmp_path / 'place.db'}", "-r", "__ns:=/test_node"])

    def made() -> RegistrarNode:
        node = RegistrarNode()
        node._registrar._store._connection.execute("PRAGMA busy_timeout = 50")
        return node

    yield made
    rclpy.try_shutdown()


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Another program writes into the store."""
    with closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
        other.rollback()


def call(node: RegistrarNode, service: str) -> Any:
    """The answer of one of the node's services, and how often its timer came to be heard meanwhile."""
    client = node.create_client(Trigger, f"~/{service}", callback_group=node.apart)
    assert client.wait_for_service(10.0)
    answer = client.call_async(Trigger.Request())
    heard: list[float] = []
    timer = node.create_timer(0.05, lambda: heard.append(time.monotonic()))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=30.0)
    node.destroy_timer(timer)
    return answer.result(), len(heard)


def test_a_store_that_is_locked_refuses_a_reset_and_keeps_what_waits(make: Making, tmp_path: Path) -> None:
    node = make()
    node._registrar.track(frame(0, CUP))
    stretch = node._registrar.end()
    assert stretch is not None
    node._registrar.search(stretch)
    with held(tmp_path / "place.db"):
        answer, _ = call(node, "reset")
        assert not answer.success and "place.db: cannot forget everything" in answer.message
    assert node._registrar.counts()["keyframes"] == 1
    answer, _ = call(node, "reset")
    assert answer.success and node._registrar.counts()["keyframes"] == 0
    node.close()


def test_messages_are_heard_while_a_reset_waits_for_the_search_in_hand(make: Making) -> None:
    node = make()
    busy = threading.Event()

    def search() -> None:
        with node._registrar._lock:
            busy.set()
            time.sleep(1.0)

    searching = threading.Thread(target=search)
    searching.start()
    busy.wait()
    answer, heard = call(node, "reset")
    searching.join()
    assert answer.success and heard >= 5
    node.close()


def test_the_keyframe_that_a_save_ends_comes_after_those_that_wait(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, stored = make(), []
    search = node._registrar.search

    def slow(stretch: Stretch, seconds: float) -> Outcome:
        time.sleep(0.2)
        stored.append(stretch.frames[0].stamp_ns // SECOND)
        return search(stretch, seconds)

    monkeypatch.setattr(node._registrar, "search", slow)
    for seconds in (0, 10):
        node._registrar.track(frame(seconds, CUP))
        stretch = node._registrar.end()
        assert stretch is not None
        node.accept(seconds * SECOND)
        node.searcher.put((seconds * SECOND, stretch))
    node._registrar.track(frame(20, CUP))
    answer, _ = call(node, "save")
    assert answer.success and stored == [0, 10, 20]
    node.close()


def test_frames_of_two_cameras_are_told_with_what_to_do(make: Making) -> None:
    node, said = make(), []
    node.throttled._write = said.append
    for frame_id in ("front", "front", "rear", "front"):
        node._watch_camera(frame_id)
    (line,) = said
    assert "got one of 'rear' after one of 'front'" in line and "a registrar of its own" in line
    node.close()


def with_two_to_store(node: RegistrarNode) -> RegistrarNode:
    """The node with a keyframe that waits for its search, and another in hand."""
    node._registrar.track(frame(0, CUP))
    waiting = node._registrar.end()
    assert waiting is not None
    node.searcher.close()
    node.searcher.put((0, waiting))
    node._registrar.track(frame(30, CUP))
    return node


@pytest.mark.parametrize("shut_down", [False, True])
def test_the_node_ends_well_where_its_last_keyframes_cannot_be_stored(
    make: Making, tmp_path: Path, capfd: pytest.CaptureFixture[str], shut_down: bool
) -> None:
    node = with_two_to_store(make())
    with held(tmp_path / "place.db"):
        if shut_down:
            rclpy.shutdown()
        node.close()
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "lost" in line]
    assert "2 are lost" in line and "place.db: cannot write keyframe 1" in line
    Store(tmp_path / "place.db").close()  # it was let go of
    assert not list(node.publishers)  # it was destroyed


def test_a_keyframe_that_cannot_be_stored_is_not_in_the_way_of_the_next(
    make: Making, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = with_two_to_store(make())
    add, tries = node._registrar._store.add, []

    def full_once(*arguments: Any) -> None:
        tries.append(arguments)
        if len(tries) == 1:
            raise OSError("the disk is full")
        add(*arguments)

    monkeypatch.setattr(node._registrar._store, "add", full_once)
    node.close()
    stored = Store(tmp_path / "place.db", read_only=True)
    assert [stored.keyframe(k).stamp_ns for k in stored.keyframe_ids()] == [30_000_000_000]
    stored.close()
