# SPDX-License-Identifier: Apache-2.0
"""How ROS begins in a process, and how signals end it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import ExternalShutdownException

from objreg_ros.bridge.process.lifetime import FirstSignal, begin, shutdown_as_interrupt


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


THREADS = """
import ctypes, sys, threading
import numpy as np
from objreg_ros.bridge.process.lifetime import share_arenas
libc = ctypes.CDLL(None)
if sys.argv[1] == "shared":
    share_arenas()
met = threading.Barrier(8)
def work():
    kept = [np.ones(1000) for _ in range(100)]
    met.wait()
threads = [threading.Thread(target=work) for _ in range(8)]
[thread.start() for thread in threads], [thread.join() for thread in threads]
libc.fopen.restype = ctypes.c_void_p
libc.malloc_info(0, ctypes.c_void_p(libc.fopen(b"/dev/stdout", b"w")))
libc.fflush(None)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator has no arenas")
def test_all_threads_of_a_node_share_a_few_arenas_of_the_allocator(repository: Path) -> None:
    def arenas(how: str) -> int:
        environment = os.environ | {"PYTHONPATH": str(repository), "OPENBLAS_NUM_THREADS": "1"}
        command = [sys.executable, "-c", THREADS, how]
        output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        return output.count("<heap nr=")

    assert arenas("shared") < arenas("as they come")


@pytest.mark.parametrize(
    ("is_up", "text", "expected"),
    [
        (False, "Unable to convert call argument '0' to Python object", KeyboardInterrupt),
        (True, "Unable to convert call argument '0' to Python object", RuntimeError),
        (False, "a bug", RuntimeError),
    ],
)
def test_a_signal_while_a_message_is_converted_is_an_interrupt_and_a_bug_is_none(
    is_up: bool, text: str, expected: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("objreg_ros.bridge.process.lifetime.rclpy.ok", lambda: is_up)
    with pytest.raises(expected), shutdown_as_interrupt():
        raise RuntimeError(text)
