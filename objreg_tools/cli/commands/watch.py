# SPDX-License-Identifier: Apache-2.0
"""`objreg watch`: a running graph on a page of this machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from objreg_tools.cli.watching.listening import listening
from objreg_tools.cli.watching.server import served
from objreg_tools.cli.watching.watched import Watched

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

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
    ros_args = [word for rule in rules for word in ("-r", rule)]
    watched = Watched()
    with (
        listening(lambda context: _node(context, watched, ros_args), ros_args) as executor,
        served(watched, port) as address,
    ):
        click.echo(f"{address} shows the graph; Ctrl-C ends it")
        while True:
            executor.spin_once(timeout_sec=0.2)


def _node(context: Context, watched: Watched, ros_args: list[str]) -> Node:
    from objreg_tools.cli.watching.topics import watch  # which knows ROS

    return watch(context, watched, ros_args)
