# SPDX-License-Identifier: Apache-2.0
"""From `main` to a running node and to its end: the exit status, what is said, and what is left behind."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation

from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.spin import run


@pytest.fixture(autouse=True)
def on_its_own(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A graph that ends at this machine; the transport and the frozen garbage of a node are not for other tests."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr("objreg_ros.bridge.process.profile.apply", lambda **_: "the transport")
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
    gc.unfreeze()
    rclpy.try_shutdown()


class Short(NodeBase):
    """A node that soon meets its end, and remembers that it was closed."""

    made: Short | None = None

    def __init__(self, error: BaseException | None = None) -> None:
        super().__init__("short")
        Short.made, self.closed, self.error = self, False, error
        self.soon = self.create_timer(0.01, self.end)

    def end(self) -> None:
        if self.error is not None:
            self.fail(self.error)
        else:
            rclpy.shutdown()

    def close(self) -> None:
        self.closed = True
        super().close()


def ended_well() -> bool:
    return Short.made is not None and Short.made.closed and not rclpy.ok()


def test_a_node_that_is_asked_to_end_is_closed_with_status_0() -> None:
    class Terminated(Short):
        def end(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            while rclpy.ok():  # it is received in another thread
                time.sleep(0.001)

    assert run(Terminated, []) == 0 and ended_well()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_node_is_made_ends_it_at_once_with_status_0(number: signal.Signals) -> None:
    went_on = []

    def make() -> NodeBase:
        os.kill(os.getpid(), number)
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline:
            time.sleep(0.001)
        went_on.append(True)
        return Short()

    assert run(make, []) == 0 and not went_on and not rclpy.ok()


def test_what_ros_says_of_a_node_that_a_signal_caught_half_made_is_no_bug() -> None:
    def make() -> NodeBase:
        rclpy.shutdown()
        return Short()

    assert run(make, []) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_another_signal_does_not_interrupt_what_is_written_at_the_end(number: signal.Signals) -> None:
    written = []

    class Writing(Short):
        def end(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)

        def close(self) -> None:
            for _ in range(3):
                os.kill(os.getpid(), number)
                time.sleep(0.01)
            written.append("the last keyframe")
            super().close()

    assert run(Writing, []) == 0 and ended_well() and written


@pytest.mark.parametrize("error", [OSError, ValueError])
def test_what_cannot_be_written_at_the_end_is_one_line_and_status_1(
    error: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    class Full(Short):
        def close(self) -> None:
            super().close()
            raise error("disk\n full")

    assert run(Full, []) == 1 and ended_well()
    assert capsys.readouterr().err.splitlines()[-1] == "short: its last work is lost: disk full"


@pytest.mark.parametrize("content", ["/**:\n  threshold: 0.4\n", "/**:\n  ros__parameters:\n    model: 'open\n"])
def test_an_ill_formed_parameter_file_is_one_line_of_ours_and_status_1(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "ill.yaml"
    file.write_text(content)
    assert run(Short, ["--ros-args", "--params-file", str(file)]) == 1 and not rclpy.ok()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("ROS arguments: expected remaps like") and "ill.yaml" in line


def test_a_node_that_is_interrupted_is_closed_with_status_0() -> None:
    class Interrupted(Short):
        def end(self) -> None:
            raise KeyboardInterrupt

    assert run(Interrupted, []) == 0 and ended_well()


def test_a_node_whose_ros_is_shut_down_ends_with_status_0() -> None:
    assert run(Short, []) == 0 and ended_well()


def test_a_node_whose_ros_is_shut_down_while_it_waits_ends_with_status_0() -> None:
    class Waiting(Short):
        def end(self) -> None:
            self.destroy_timer(self.soon)
            threading.Timer(0.05, rclpy.shutdown).start()

    assert run(Waiting, []) == 0 and ended_well()


def test_what_breaks_a_worker_propagates_and_the_node_is_closed() -> None:
    with pytest.raises(RuntimeError, match="a bug"):
        run(lambda: Short(RuntimeError("a bug")), [])
    assert ended_well()


@pytest.mark.parametrize("error", [ValueError, FileNotFoundError])
def test_what_a_node_refuses_at_start_is_one_line_and_status_1(
    error: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> NoReturn:
        raise error("expected a model,\n    got  none")

    assert run(refuse, []) == 1
    assert capsys.readouterr().err == "expected a model, got none\n" and not rclpy.ok()


def test_a_bug_at_start_propagates_and_leaves_no_ros_behind() -> None:
    with pytest.raises(ZeroDivisionError):
        run(lambda: 1 / 0, [])  # type: ignore[arg-type, return-value]
    assert not rclpy.ok()


@pytest.mark.parametrize("is_down", [True, False])
def test_what_ros_says_because_it_was_just_shut_down_is_no_bug(is_down: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def break_off(*_: object) -> NoReturn:
        if is_down:
            rclpy.shutdown()
        raise rclpy_implementation.RCLError("failed to initialize wait set: the given context is not valid")

    monkeypatch.setattr(SingleThreadedExecutor, "spin_once", break_off)
    if is_down:
        assert run(Short, []) == 0 and ended_well()
    else:
        with pytest.raises(rclpy_implementation.RCLError):
            run(Short, [])


def test_what_a_node_receives_leaves_nothing_behind() -> None:
    counts: list[int] = []

    class Counting(Short):
        def end(self) -> None:
            gc.collect()
            counts.append(len(gc.get_objects()))
            if len(counts) == 60:
                super().end()

    assert run(Counting, []) == 0
    assert counts[-1] - counts[20] < 40, "a callback a round stays"


def test_the_arguments_reach_ros() -> None:
    names: list[str] = []

    def make() -> NodeBase:
        node = Short()
        names.append(node.get_fully_qualified_name())
        return node

    run(make, ["--ros-args", "-r", "__ns:=/robot", "-r", "__node:=cell"])
    assert names == ["/robot/cell"]


def test_what_was_made_at_the_start_is_not_looked_through_again() -> None:
    frozen: list[int] = []

    class Counting(Short):
        def end(self) -> None:
            frozen.append(gc.get_freeze_count())
            super().end()

    assert gc.get_freeze_count() == 0
    run(Counting, [])
    assert frozen[0] > 10_000
