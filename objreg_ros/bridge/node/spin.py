# SPDX-License-Identifier: Apache-2.0
"""From `main` to a running node, and to a clean end."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Sequence

import rclpy

from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.process import profile, shared_memory
from objreg_ros.bridge.process.lifetime import (
    FirstSignal,
    begin,
    receive_first_signal,
    settle,
    share_arenas,
    shutdown_as_interrupt,
)
from objreg_ros.bridge.process.sparing_executor import SparingExecutor
from objreg_ros.terminal import protect_terminal


def run(make: Callable[[], NodeBase], args: Sequence[str] | None = None) -> int:
    """Run one node until SIGINT or SIGTERM; the exit status.

    What ROS or the node refuses at start, and what cannot be written at the end (ValueError, OSError), is one line on
    stderr and status 1. A bug propagates.
    For the main thread of a process that ends with it: signals stay unheard.
    """
    return run_together((make,), args)


def run_together(makes: Sequence[Callable[[], NodeBase]], args: Sequence[str] | None = None) -> int:
    """Run nodes in one executor, as `run` does one; made and closed in this order, and ended together."""
    protect_terminal()
    first_signal = receive_first_signal()
    share_arenas()
    transport = profile.apply(ours=profile.NODE)
    shared_memory.free_abandoned()
    try:
        begin(args)
    except ValueError as error:
        return _refuse(error)
    try:
        with shutdown_as_interrupt():
            return _serve(makes, transport, first_signal)
    except KeyboardInterrupt:  # before there was a node
        return 0
    finally:
        first_signal.deafen()
        rclpy.try_shutdown()
        gc.freeze()  # else Python looks through every object of every library once more before it ends


def _refuse(error: Exception) -> int:
    print(" ".join(str(error).split()), file=sys.stderr)
    return 1


def _serve(makes: Sequence[Callable[[], NodeBase]], transport: str, first_signal: FirstSignal) -> int:
    executor, nodes = SparingExecutor(), list[NodeBase]()
    try:
        try:
            refused = _make(makes, nodes)
            if refused is None:
                _spin(nodes, executor, transport)
        except BaseException:
            first_signal.deafen()
            _close(nodes)
            raise
        first_signal.deafen()
        return max(_close(nodes), 0 if refused is None else _refuse(refused))
    finally:
        executor.shutdown()  # last: the thread that received the signal may still ring the bell that this takes down


def _make(makes: Sequence[Callable[[], NodeBase]], nodes: list[NodeBase]) -> Exception | None:
    """Make every node, into ``nodes``; what one was refused for."""
    try:
        for make in makes:
            nodes.append(make())
    except (ValueError, OSError) as error:
        return error
    return None


def _spin(nodes: Sequence[NodeBase], executor: SparingExecutor, transport: str) -> None:
    """Until a signal, or until a managed node was shut down; what ended a worker is raised."""
    try:
        with shutdown_as_interrupt():
            nodes[0].get_logger().info(transport)
            settle()
            for node in nodes:
                executor.add_node(node)
            # Not `spin_until_future_complete`: it keeps a callback of every round for ever, 100 MB an hour. What broke
            # a worker is seen with the next round, at the latest that of the diagnostics.
            while rclpy.ok() and not any(node.failure.done() for node in nodes):
                executor.spin_once()
    except KeyboardInterrupt:
        return
    for node in nodes:
        if rclpy.ok() and node.failure.done():
            node.failure.result()


def _close(nodes: Sequence[NodeBase]) -> int:
    """The exit status of all; who speaks ends before who receives it."""
    return max([_close_one(node) for node in nodes], default=0)


def _close_one(node: NodeBase) -> int:
    """The exit status; what cannot be written any more is said, since nobody else would."""
    name = node.get_name()
    try:
        node.close()
    except (ValueError, OSError) as error:
        return _refuse(OSError(f"{name}: its last work is lost: {error}"))
    return 0
