# SPDX-License-Identifier: Apache-2.0
"""How ROS begins in a process, and how signals end it."""

from __future__ import annotations

import ctypes
import gc
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress

import rclpy
from rclpy.exceptions import NotInitializedException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation

REFUSED = rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError
SOURCE_LINE = re.compile(r",? at /\S+:\d+")  # of rcl's own code, in what it says
SIGNALS = signal.SIGINT, signal.SIGTERM
REPORT_S = 5.0  # between two lines of a work that goes on
LOOK_S = 0.1  # a signal is received by then


M_ARENA_MAX, ARENAS = -8, 2  # mallopt(3): of the GNU C library, which else has eight for each core


def share_arenas() -> None:
    """Let all threads of this process share a few of the allocator's arenas. Elsewhere than on glibc nothing happens.

    Each arena keeps what was freed in it, so a node with a dozen threads would hold hundreds of megabytes of nothing,
    and more by the hour. To be called before there are threads.
    """
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, ARENAS)


def settle() -> None:
    """What was made until now stays: no collection of garbage has to look through it between two frames."""
    gc.collect()
    gc.freeze()


UNCONVERTED = "Unable to convert call argument"  # what pybind11 makes of a signal while rclpy converts a large message


class FirstSignal:
    """A handler that raises KeyboardInterrupt once: who presses Ctrl-C again does not interrupt what is still written.

    rclpy's own handler, which shuts ROS down, calls it afterwards.
    """

    def __init__(self) -> None:
        self._is_received = False

    def __call__(self, *_: object) -> None:
        if not self._is_received:
            self._is_received = True
            raise KeyboardInterrupt

    def deafen(self) -> None:
        """From now on no signal interrupts."""
        self._is_received = True


def receive_first_signal() -> FirstSignal:
    """Let the first SIGINT or SIGTERM interrupt the main thread, from which this has to be called, before `begin`."""
    handler = FirstSignal()
    for number in SIGNALS:
        signal.signal(number, handler)
    return handler


def begin(args: Sequence[str] | None) -> None:
    """Initialise ROS with arguments, those of the process if None; ValueError for what it cannot read of them."""
    try:
        rclpy.init(args=None if args is None else list(args))
    except REFUSED as error:
        said = " ".join(SOURCE_LINE.sub("", str(error)).split())
        raise ValueError(
            "ROS arguments: expected remaps like -r __ns:=/robot, parameters like -p name:=value, and parameter files "
            f"of node: ros__parameters: name: value; got: {said}"
        ) from error


@contextmanager
def shutdown_as_interrupt() -> Iterator[None]:
    """What ROS says because a signal shut it down between two of its own steps becomes KeyboardInterrupt."""
    try:
        yield
    except ExternalShutdownException as error:
        raise KeyboardInterrupt from error
    except (rclpy_implementation.RCLError, NotInitializedException) as error:
        if rclpy.ok():
            raise
        raise KeyboardInterrupt from error
    except RuntimeError as error:
        if rclpy.ok() or UNCONVERTED not in str(error):
            raise
        raise KeyboardInterrupt from error


class Abandoned(KeyboardInterrupt):
    """A signal came while a thread was at work that nobody can stop."""


def await_kernels(prepare: Callable[[], object], say: Callable[[str], object], report_s: float = REPORT_S) -> None:
    """Let ``prepare`` load or compile the kernels of a node in a thread of its own; report the start and the progress.

    A signal is received at once: what it interrupts raises `Abandoned`. What ``prepare`` raises is raised.
    """
    done: Future[None] = Future()

    def work() -> None:
        try:
            prepare()
        except BaseException as error:
            done.set_exception(error)
        else:
            done.set_result(None)

    say("loading the kernels; a first start compiles them, which takes minutes on a slow or busy machine")
    thread, begun, reports = threading.Thread(target=work, name="kernels", daemon=True), time.monotonic(), 1
    try:
        thread.start()
        while not done.done():
            thread.join(LOOK_S)
            lasted_s = time.monotonic() - begun
            if lasted_s >= reports * report_s and not done.done():
                say(f"still loading or compiling kernels, for {lasted_s:.0f} s now; Ctrl-C ends this at once")
                reports = int(lasted_s / report_s) + 1
    except KeyboardInterrupt as signalled:
        raise Abandoned from signalled
    done.result()
