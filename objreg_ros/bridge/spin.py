# SPDX-License-Identifier: Apache-2.0
"""From `main` to a running node, and to a clean end."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation

from objreg_ros.bridge import profile
from objreg_ros.bridge.door import Door


def run(make: Callable[[], Door], args: Sequence[str] | None = None) -> int:
    """Run one node until SIGINT or SIGTERM; the exit status.

    What the node refuses at start (ValueError, OSError) is one line on stderr and status 1. A bug propagates.
    """
    transport = profile.apply()
    rclpy.init(args=None if args is None else list(args))
    try:
        return _serve(make, transport)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        rclpy.try_shutdown()
        gc.freeze()  # else Python looks through every object of every library once more before it ends


def _settle() -> None:
    """What was made at the start stays: no collection of garbage has to look through it between two frames."""
    gc.collect()
    gc.freeze()


@contextmanager
def _unless_shut_down() -> Iterator[None]:
    """What ROS says because a signal ended it between two of its own steps is no error."""
    try:
        yield
    except rclpy_implementation.RCLError:
        if rclpy.ok():
            raise


def _serve(make: Callable[[], Door], transport: str) -> int:
    try:
        door = make()
    except (ValueError, OSError) as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return 1
    door.get_logger().info(transport)
    _settle()
    executor = SingleThreadedExecutor()
    executor.add_node(door)
    try:
        with _unless_shut_down():
            executor.spin_until_future_complete(door.failure)
        if rclpy.ok() and door.failure.done():
            door.failure.result()  # raises what ended the worker
        return 0
    finally:
        try:
            door.close()
        finally:
            executor.shutdown()  # last: the thread that heard the signal may still ring the bell that this takes down
