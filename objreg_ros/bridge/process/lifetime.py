# SPDX-License-Identifier: Apache-2.0
"""How ROS begins in a process, and how signals end it."""

from __future__ import annotations

import ctypes
import gc
import re
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

import rclpy
from rclpy.exceptions import NotInitializedException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation

REFUSED = rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError
SOURCE_LINE = re.compile(r",? at /\S+:\d+")  # of rcl's own code, in what it says
SIGNALS = signal.SIGINT, signal.SIGTERM


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
