# SPDX-License-Identifier: Apache-2.0
"""How ROS begins in a process, and how signals end it."""

from __future__ import annotations

import _thread
import threading

import pytest
import rclpy
from rclpy.executors import ExternalShutdownException

from objreg_ros.bridge.lifetime import Abandoned, FirstSignal, await_kernels, begin, shutdown_as_interrupt


def test_only_the_first_signal_interrupts() -> None:
    handler = FirstSignal()
    with pytest.raises(KeyboardInterrupt):
        handler(15, None)
    handler(15, None)


def test_after_work_is_done_no_signal_interrupts() -> None:
    handler = FirstSignal()
    handler.deafen()
    handler(2, None)


@pytest.mark.parametrize("wrong", [["-r", "__ns=/robot"], ["-p", "threshold"], ["--params-file", "/nowhere.yaml"]])
def test_arguments_that_ros_cannot_read_are_refused_with_what_was_expected(wrong: list[str]) -> None:
    with pytest.raises(ValueError, match=r"ROS arguments: expected remaps like -r __ns:=/robot.*got: \S") as refused:
        begin(["--ros-args", *wrong])
    assert ".c:" not in str(refused.value)
    assert not rclpy.ok()


def test_what_ros_says_because_it_was_shut_down_becomes_an_interruption() -> None:
    with pytest.raises(KeyboardInterrupt), shutdown_as_interrupt():
        raise ExternalShutdownException


def test_a_bug_stays_a_bug() -> None:
    with pytest.raises(ZeroDivisionError), shutdown_as_interrupt():
        1 / 0  # noqa: B018


def test_who_waits_for_kernels_is_told_before_and_while_they_compile() -> None:
    said: list[str] = []
    enough = threading.Event()

    def say(line: str) -> None:
        said.append(line)
        if len(said) == 3:
            enough.set()

    await_kernels(lambda: enough.wait(10.0), say, tell_s=0.01)
    assert said[0].startswith("loading the kernels; a first start compiles them")
    assert said[1].startswith("still loading or compiling kernels, for ") and len(said) >= 3


def test_what_the_kernels_raise_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        await_kernels(lambda: 1 / 0, str)


def test_a_signal_while_kernels_compile_abandons_them() -> None:
    compiled = threading.Event()

    def compile_long() -> None:
        _thread.interrupt_main()
        compiled.wait(10.0)

    with pytest.raises(Abandoned):
        await_kernels(compile_long, str)
    compiled.set()
