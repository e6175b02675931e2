# SPDX-License-Identifier: Apache-2.0
"""The node of the registrar where keyframes wait, cameras change and its store does not let it."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter
from registration.samples import SECOND, box, frame, keyframe
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe
from objreg_ros.bridge.node.diagnostics import refusal_of
from objreg_ros.bridge.streams.keyframes_in import FromRobot
from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import pose
from objreg_ros.keyframes.frame_window import Arrival, Clock, FrameWindow
from objreg_ros.memory.store import Store
from objreg_ros.registrar.node import MOST_ASKING, Job, RegistrarNode
from objreg_ros.registrar.outcome import Outcome

CUP = (box("cup", (0, 0, 1)),)
Making = Callable[[], RegistrarNode]


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Making]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    parameters = f"store:={tmp_path / 'place.db'}", "allow_remote_reset:=true"
    rclpy.init(args=["--ros-args", *(part for one in parameters for part in ("-p", one)), "-r", "__ns:=/test_node"])

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
    """The answer of a service of the node once that has rested, and how often its timer was called meanwhile."""
    while (answered := called(node, service))[0].message.startswith(f"~/{service}: call again"):
        time.sleep(0.1)
    return answered


def called(node: RegistrarNode, service: str) -> Any:
    client = node.create_client(Trigger, f"~/{service}", callback_group=node.apart)
    assert client.wait_for_service(10.0)
    answer = client.call_async(Trigger.Request())
    received: list[float] = []
    timer = node.create_timer(0.05, lambda: received.append(time.monotonic()))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=300.0)
    node.destroy_timer(timer)
    return answer.result(), len(received)


def test_a_store_that_is_locked_refuses_a_reset_and_keeps_what_waits(make: Making, tmp_path: Path) -> None:
    node = make()
    node._registrar.track(frame(0, CUP))
    (window,) = node._registrar.end_windows()
    node._registrar.search(window)
    with held(tmp_path / "place.db"):
        answer, _ = call(node, "reset")
        assert not answer.success and "place.db: cannot" in answer.message
    assert node._registrar.counts()["keyframes"] == 1
    answer, _ = call(node, "reset")
    assert answer.success and node._registrar.counts()["keyframes"] == 0
    node.close()


def test_a_store_in_a_file_is_not_reset_unless_the_start_allows_it(make: Making) -> None:
    node = make()
    node._may_reset = False
    node._registrar.track(frame(0, CUP))
    answer, _ = call(node, "reset")
    assert not answer.success and "expected allow_remote_reset:=true for a store in a file" in answer.message
    assert len(node._registrar.end_windows()) == 1  # nor is the keyframe in hand gone
    node.close()


def test_a_reset_says_where_what_was_stored_is_now(make: Making, tmp_path: Path) -> None:
    node = make()
    node._registrar.track(frame(0, CUP))
    (window,) = node._registrar.end_windows()
    node._registrar.search(window)
    answer, _ = call(node, "reset")
    (aside,) = tmp_path.glob("place-*.db")
    assert answer.success and answer.message == f"forgot every keyframe; what was stored is in {aside}"
    node.close()


def test_refusals_have_a_topic_of_their_own_and_their_counts_are_in_the_diagnostics(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, published, status = make(), [], []
    monkeypatch.setattr(node._announcements._refusals, "publish", published.append)
    monkeypatch.setattr(node._diagnostics, "publish", status.append)
    turned_down = Rejected(reason=Reason.NO_CANDIDATE, from_ns=5, to_ns=9, detail="none of 3")
    node._publish(Outcome(rejected=(turned_down,)))
    assert node._announcements._refusals.topic_name == "/test_node/refusals" and status == []
    (message,) = published
    assert [refusal_of(one).detail for one in message.status] == ["none of 3"]
    node._report()
    values = {pair.key: pair.value for pair in status[0].status[0].values}
    assert values["rejected: no_candidate"] == "1"
    node.close()


def test_messages_are_received_while_a_reset_waits_for_the_search_in_hand(make: Making) -> None:
    node = make()
    busy = threading.Event()

    def search() -> None:
        with node._registrar._lock:
            busy.set()
            time.sleep(1.0)

    searching = threading.Thread(target=search)
    searching.start()
    busy.wait()
    answer, received = call(node, "reset")
    searching.join()
    assert answer.success and received >= 5
    node.close()


def test_the_keyframe_that_a_save_ends_comes_after_those_that_wait(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, stored = make(), []
    search = node._registrar.search

    def slow(window: FrameWindow, seconds: float, hurried: Callable[[], bool]) -> Outcome:
        time.sleep(0.2)
        stored.append(window.frames[0].stamp_ns // SECOND)
        return search(window, seconds, hurried)

    monkeypatch.setattr(node._registrar, "search", slow)
    for seconds in (0, 10):
        node._registrar.track(frame(seconds, CUP))
        (window,) = node._registrar.end_windows()
        node.accept(seconds * SECOND)
        node.searcher.put(Job(seconds * SECOND, window, time.monotonic()))
    node._registrar.track(frame(20, CUP))
    answer, _ = call(node, "save")
    assert answer.success and stored == [0, 10, 20]
    node.close()


def test_others_are_sent_the_keyframe_that_a_save_ends(make: Making) -> None:
    node, sent = make(), []
    node._robot, node._exchange = "robot", SimpleNamespace(announce=lambda outcome: outcome.keyframe_id)
    node._others = SimpleNamespace(send=lambda stamp_ns, summary: sent.append((stamp_ns, summary)), close=lambda: None)
    node._registrar.track(frame(20, CUP))
    assert node._settle_and_save()[0] and sent == [(20 * SECOND, 1)]
    node.close()


def test_a_keyframe_that_is_being_unpacked_is_not_stored_after_a_reset(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, begun = make(), threading.Event()
    arrival = Arrival(keyframe(0, 5), Clock(0, 0), "a" * 32)

    def unpacked_slowly(*_: object) -> Arrival:
        begun.set()
        time.sleep(0.3)
        return arrival

    monkeypatch.setattr("objreg_ros.registrar.node.arrival_of", unpacked_slowly)
    node._keyframes = SimpleNamespace(count=lambda robot, what: None)
    node.accept(5 * SECOND)
    sent = SentKeyframe(5 * SECOND, "camera", "a" * 32, 0, 0, b"packed")
    node.searcher.put(Job(5 * SECOND, FromRobot("robot", sent), time.monotonic()))
    assert begun.wait(60.0)
    assert node._forget()[0]
    node.searcher.drain()
    assert node._registrar.counts()["keyframes"] == 0
    node.close()


def test_a_full_store_says_what_goes(make: Making, monkeypatch: pytest.MonkeyPatch) -> None:
    node, said = make(), []
    node.throttled._write = said.append
    full = {**node._registrar.counts(), "keyframes": 2, "forgotten": 3}
    monkeypatch.setattr(node._registrar, "counts", lambda: full)
    for _ in range(2):
        node._publish(Outcome())
    (line,) = said
    assert "keeps 2 keyframes (max_keyframes, max_megabytes), and has forgotten the oldest 3" in line
    assert by_key(*node.own_diagnostics())["forgotten keyframes"] == 3
    node.close()


def with_two_to_store(node: RegistrarNode) -> RegistrarNode:
    """The node with a keyframe that waits for its search, and another in hand."""
    node._registrar.track(frame(0, CUP))
    (waiting,) = node._registrar.end_windows()
    node.searcher.close()
    node.searcher.put(Job(0, waiting, time.monotonic()))
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


def test_a_bug_in_one_of_the_last_keyframes_loses_no_other(
    make: Making, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    node = with_two_to_store(make())
    search, seen = node._registrar.search, list[FrameWindow]()

    def broken_once(window: FrameWindow, *rest: Any) -> Outcome:
        seen.append(window)
        if len(seen) == 1:
            raise KeyError("bug")
        return search(window, *rest)

    monkeypatch.setattr(node._registrar, "search", broken_once)
    node.close()
    assert "1 are lost: KeyError" in capfd.readouterr().err
    left = Store(tmp_path / "place.db")
    assert left.counts()["keyframes"] == 1
    left.close()


def test_a_keyframe_that_cannot_be_stored_is_not_in_the_way_of_the_next(
    make: Making, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = with_two_to_store(make())
    add, tries = node._registrar._store.write_keyframe, []

    def full_once(*arguments: Any) -> None:
        tries.append(arguments)
        if len(tries) == 1:
            raise OSError("the disk is full")
        add(*arguments)

    monkeypatch.setattr(node._registrar._store, "write_keyframe", full_once)
    node.close()
    stored = Store(tmp_path / "place.db", read_only=True)
    assert [stored.keyframe(k).stamp_ns for k in stored.keyframe_ids()] == [30_000_000_000]
    stored.close()


def window_at(node: RegistrarNode, seconds: int) -> FrameWindow:
    node._registrar.track(frame(seconds, CUP))
    (window,) = node._registrar.end_windows()
    node.accept(seconds * SECOND)
    return window


def test_keyframes_that_wait_behind_a_long_search_are_bounded_and_stored_in_the_order_of_their_stamps(
    make: Making, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, said = make(), list[str]()
    node.throttled._write = said.append
    waiting, begun = list[int](), threading.Event()
    close_loops = node._registrar._close_loops

    def try_for_long(*arguments: Any) -> Any:
        begun.set()
        _, _, budget, *_ = arguments
        while budget.deadline > time.monotonic() and not budget.hurried():
            time.sleep(0.005)
        return close_loops(*arguments)

    monkeypatch.setattr(node._registrar, "_close_loops", try_for_long)
    for k in range(30):
        node.searcher.put(Job(10 * k * SECOND, window_at(node, 10 * k), time.monotonic()))
        waiting.append(len(node.searcher))
        assert begun.wait(60.0)
    node.close()
    stored = Store(tmp_path / "place.db", read_only=True)
    assert [stored.keyframe(k).stamp_ns for k in stored.keyframe_ids()] == [10 * k * SECOND for k in range(30)]
    stored.close()
    assert max(waiting) <= 8 and node._unsearched > 0
    assert any("stored without a search" in line for line in said)


def test_a_node_ends_at_once_in_the_middle_of_a_search_and_stores_everything(
    make: Making, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, begun, hurried = make(), threading.Event(), list[bool]()
    search = node._registrar.search

    def search_for_ever(window: FrameWindow, seconds: float, hurry: Callable[[], bool] = lambda: False) -> Outcome:
        begun.set()
        deadline = time.monotonic() + 20.0
        while seconds and not hurry() and time.monotonic() < deadline:
            time.sleep(0.005)
        hurried.append(hurry())
        return search(window, seconds, hurry)

    monkeypatch.setattr(node._registrar, "search", search_for_ever)
    node.searcher.put(Job(0, window_at(node, 0), time.monotonic()))
    assert begun.wait(60.0)
    for k in (10, 20):
        node.searcher.put(Job(k * SECOND, window_at(node, k), time.monotonic()))
    node._registrar.track(frame(30, CUP))
    node.close()
    assert hurried[0]
    stored = Store(tmp_path / "place.db", read_only=True)
    assert [stored.keyframe(k).stamp_ns // SECOND for k in stored.keyframe_ids()] == [0, 10, 20, 30]
    stored.close()


def test_a_running_node_takes_live_parameters_and_refuses_the_others(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make()
    monkeypatch.setattr(node, "frame_of", lambda seen: (seen, None))

    def see(seconds: int) -> None:
        """One frame, which ends the keyframe of the one before; that one is searched for when this returns."""
        node.accept(seconds * SECOND)
        T_odom_camera = pose(np.eye(3), np.array([0.01 * seconds, 0.0, 0.0]))
        node.compute(seconds * SECOND, frame(seconds, CUP, T_odom_camera))
        node.searcher.drain()

    see(0)
    see(30)
    assert node._announcements._refused == {Reason.NO_CANDIDATE.value: 1}
    (result,) = node.set_parameters([Parameter("min_gap", value=70)])
    assert result.successful, result.reason
    see(60)
    assert node._announcements._refused == {Reason.NO_CANDIDATE.value: 2}
    assert all(r.successful for r in node.set_parameters([Parameter("min_gap", value=2.0)]))
    assert all(r.successful for r in node.set_parameters([Parameter("search_seconds", value=1e-9)]))
    see(90)
    refused = node._announcements._refused
    assert refused[Reason.OVER_BUDGET.value] > 0 and refused[Reason.NO_CANDIDATE.value] == 2
    (result,) = node.set_parameters([Parameter("store", value="other.db")])
    assert not result.successful
    node.close()


@pytest.mark.parametrize(("words", "got"), [((), "none"), (("-p", "robots:=[r1]", "-r", "__ns:=/r1"), "robots")])
def test_keyframes_are_exchanged_by_one_robot_that_its_namespace_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], got: str
) -> None:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    rclpy.init(args=["registrar", "--ros-args", "-p", "exchange:=/fleet", *words])
    try:
        with pytest.raises(ValueError, match=f"exchange: expected a namespace, which names one robot, got {got}"):
            RegistrarNode()
    finally:
        rclpy.try_shutdown()


def test_where_is_answered_by_a_thread_and_refused_where_too_many_ask(make: Making) -> None:
    node = make()
    executor = rclpy.get_global_executor()
    executor.add_node(node)
    asked = executor.create_task(node._where(SimpleNamespace(label="cup"), SimpleNamespace()))
    rclpy.spin_until_future_complete(node, asked, timeout_sec=30.0)
    answer = asked.result()
    assert not answer.success and answer.message == "no cup is known; there are: no objects yet"
    assert answer.header.frame_id == "odom" and answer.landmarks == [] and node._asking == 0
    node._asking = MOST_ASKING
    with pytest.raises(StopIteration) as refused:
        node._where(SimpleNamespace(label="cup"), SimpleNamespace(success=False)).send(None)
    assert refused.value.value.message.startswith("~/where: call again: 16 earlier calls")


def test_a_label_that_no_object_can_have_is_refused_before_the_registrar_is_asked(make: Making) -> None:
    node = make()
    with pytest.raises(StopIteration) as refused:
        node._where(SimpleNamespace(label="c" * 10_000), SimpleNamespace(success=False)).send(None)
    answer = refused.value.value
    assert not answer.success and node._asking == 0
    assert answer.message.startswith("label: expected at most 1000 characters, got 10000") and len(answer.message) < 200
