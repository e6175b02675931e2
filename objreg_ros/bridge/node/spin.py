# SPDX-License-Identifier: Apache-2.0
"""From `main` to a running node, and to a clean end."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor

from objreg_ros.bridge.node import profile, shared_memory
from objreg_ros.bridge.node.door import Door
from objreg_ros.bridge.node.lifetime import (
    Abandoned,
    FirstSignal,
    begin,
    hear_first_signal,
    settle,
    share_arenas,
    shutdown_as_interrupt,
)
from objreg_ros.terminal import protect_terminal


def run(make: Callable[[], Door], args: Sequence[str] | None = None) -> int:
    """Run one node until SIGINT or SIGTERM; the exit status.

    What ROS or the node refuses at start, and what cannot be written at the end (ValueError, OSError), is one line on
    stderr and status 1. A bug propagates. A signal while kernels compile ends the process here.
    For the main thread of a process that ends with it: signals stay unheard.
    """
    return run_together((make,), args)


def run_together(makes: Sequence[Callable[[], Door]], args: Sequence[str] | None = None) -> int:
    """Run nodes in one executor, as `run` does one; made and closed in this order, and ended together."""
    protect_terminal()
    first_signal = hear_first_signal()
    share_arenas()
    transport = profile.apply()
    shared_memory.free_abandoned()
    try:
        begin(args)
    except ValueError as error:
        return _refuse(error)
    try:
        with shutdown_as_interrupt():
            return _serve(makes, transport, first_signal)
    except Abandoned:
        rclpy.try_shutdown()
        return _leave()
    except KeyboardInterrupt:  # before there was a node
        return 0
    finally:
        first_signal.deafen()
        rclpy.try_shutdown()
        gc.freeze()  # else Python looks through every object of every library once more before it ends


def _refuse(error: Exception) -> int:
    print(" ".join(str(error).split()), file=sys.stderr)
    return 1


def _leave() -> int:
    """End the process with status 0 and without Python's own end, which waits for every thread that compiles."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def _serve(makes: Sequence[Callable[[], Door]], transport: str, first_signal: FirstSignal) -> int:
    executor, doors = SingleThreadedExecutor(), list[Door]()
    try:
        try:
            refused = _make(makes, doors)
            if refused is None:
                _spin(doors, executor, transport)
        except BaseException:
            first_signal.deafen()
            _close(doors)
            raise
        first_signal.deafen()
        return max(_close(doors), 0 if refused is None else _refuse(refused))
    finally:
        executor.shutdown()  # last: the thread that heard the signal may still ring the bell that this takes down


def _make(makes: Sequence[Callable[[], Door]], doors: list[Door]) -> Exception | None:
    """Make every node, into ``doors``; what one was refused for."""
    try:
        for make in makes:
            doors.append(make())
    except (ValueError, OSError) as error:
        return error
    return None


def _spin(doors: Sequence[Door], executor: SingleThreadedExecutor, transport: str) -> None:
    """Until a signal, or until a managed node was shut down; what ended a worker is raised."""
    try:
        with shutdown_as_interrupt():
            doors[0].get_logger().info(transport)
            settle()
            for door in doors:
                executor.add_node(door)
            # Not `spin_until_future_complete`: it keeps a callback of every round for ever, 100 MB an hour. What broke
            # a worker is seen with the next round, at the latest that of the diagnostics.
            while rclpy.ok() and not any(door.failure.done() for door in doors):
                executor.spin_once()
    except Abandoned:
        raise
    except KeyboardInterrupt:
        return
    for door in doors:
        if rclpy.ok() and door.failure.done():
            door.failure.result()


def _close(doors: Sequence[Door]) -> int:
    """The exit status of all; who speaks ends before who hears it."""
    return max([_close_one(door) for door in doors], default=0)


def _close_one(door: Door) -> int:
    """The exit status; what cannot be written any more is said, since nobody else would."""
    name = door.get_name()
    try:
        door.close()
    except (ValueError, OSError) as error:
        return _refuse(OSError(f"{name}: its last work is lost: {error}"))
    return 0
