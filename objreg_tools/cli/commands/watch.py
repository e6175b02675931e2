# SPDX-License-Identifier: Apache-2.0
"""`objreg watch`: a running graph on a page of this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from objreg_tools.cli.watching.server import served
from objreg_tools.cli.watching.watched import Watched

if TYPE_CHECKING:
    from rclpy.executors import SingleThreadedExecutor

PORT = 8765


@click.command()
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="Port of the page; 0: any."
)
@click.option("--namespace", default="", help="Namespace of the robot whose graph is watched.")
@click.option("--remap", "remaps", multiple=True, metavar="NAME:=TOPIC", help="Take a topic by another name, as image.")
def command(port: int, namespace: str, remaps: tuple[str, ...]) -> None:
    """Show a running graph on a page: http://127.0.0.1:8765, for browsers of this machine only.

    The last picture with its objects, the trajectory as it grows, the last constraints and refusals, counters and
    latencies. It listens to `image`, `camera_info`, `odom` and the topics of the nodes, changes nothing, and ends with
    Ctrl-C. The domain is that of ROS_DOMAIN_ID.
    """
    for remap in remaps:
        if not all(remap.partition(":=")):
            raise ValueError(f"--remap: expected NAME:=TOPIC, got {remap!r}")
    rules = [*remaps, *([f"__ns:=/{namespace.strip('/')}"] if namespace else [])]
    watched = Watched()
    with (
        _listening(watched, [word for rule in rules for word in ("-r", rule)]) as executor,
        served(watched, port) as address,
    ):
        click.echo(f"{address} shows the graph; Ctrl-C ends it")
        while True:
            executor.spin_once(timeout_sec=0.2)


@contextmanager
def _listening(watched: Watched, ros_args: list[str]) -> Iterator[SingleThreadedExecutor]:
    """What lets messages come in, for the time of a with block."""
    from objreg_ros.bridge.process import profile

    profile.apply()
    from rclpy.context import Context
    from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
    from rclpy.executors import SingleThreadedExecutor

    from objreg_ros.bridge.process.lifetime import REFUSED
    from objreg_tools.cli.watching.topics import watch

    context = Context()
    context.init(args=[])  # not the command line: its --remap is not for ROS
    try:
        try:
            node = watch(context, watched, ros_args)
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
