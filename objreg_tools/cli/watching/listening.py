# SPDX-License-Identifier: Apache-2.0
"""A node of a command that listens to a running graph, for the time of a with block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node


@contextmanager
def listening(make: Callable[[Context], Node], ros_args: Sequence[str] = ()) -> Iterator[SingleThreadedExecutor]:
    """What lets messages come in to the node of ``make``.

    ValueError, which shows ``ros_args``, where the node is refused for its names.
    """
    from objreg_ros.bridge.process import profile

    profile.apply()
    from rclpy.context import Context
    from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
    from rclpy.executors import SingleThreadedExecutor

    from objreg_ros.bridge.process.lifetime import REFUSED

    context = Context()
    context.init(args=[])  # not the command line: its --remap is not for ROS
    try:
        try:
            node = make(context)
        except (*REFUSED, InvalidNamespaceException, InvalidTopicNameException) as error:
            raise ValueError(f"expected names that ROS takes, got {' '.join(ros_args)} ({error})") from error
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        try:
            yield executor
        finally:
            node.destroy_node()
            executor.shutdown()  # last, as in `player`
    finally:
        context.try_shutdown()


def careful(node: Node, take: Callable[[Any], None]) -> Callable[[Any], None]:
    """A callback that passes over a message that breaks its contract, with a line in the log now and then."""

    def callback(message: Any) -> None:
        try:
            take(message)
        except (ValueError, KeyError, TypeError) as error:
            node.get_logger().warn(f"passed over: {error}", throttle_duration_sec=5.0)

    return callback
