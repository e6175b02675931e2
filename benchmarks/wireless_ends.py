# SPDX-License-Identifier: Apache-2.0
"""The two ends of benchmarks/wireless.py: one node sends numbered keyframes, the other writes down what it receives.

Both run in hosts of one machine, so they have one clock. Each line that the receiver writes is a
message: its number, and its age in seconds.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any, TextIO

import click

TOPIC = "keyframes"
KEPT = 64  # messages, by both ends


def qos() -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(depth=KEPT, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@click.group()
def main() -> None:
    """One end."""


@main.command()
@click.argument("count", type=int)
@click.option("--size", default=80_000, help="bytes of a message")
@click.option("--hz", default=1.0)
@click.option("--linger", "linger_s", default=0.0, help="seconds to stay after the last one")
@click.option("--met", type=click.Path(path_type=Path), help="a file that is made when there is a receiver")
def send(count: int, size: int, hz: float, linger_s: float, met: Path | None) -> None:
    """Wait for a receiver, then send so many messages."""
    import rclpy
    from sensor_msgs.msg import CompressedImage

    rclpy.init()
    node = rclpy.create_node("sender")
    publisher = node.create_publisher(CompressedImage, TOPIC, qos())
    while publisher.get_subscription_count() == 0:
        rclpy.spin_once(node, timeout_sec=0.05)
    message = CompressedImage(data=bytes(size))
    if met is not None:
        met.touch()
    start = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, start + number / hz - time.monotonic()))
        message.format = str(number)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
        publisher.publish(message)
    time.sleep(linger_s)


@main.command()
@click.argument("out", type=click.File("w", lazy=False))
def receive(out: TextIO) -> None:
    """Write a line for each message until the process is ended."""
    import rclpy
    from sensor_msgs.msg import CompressedImage

    def write_down(message: Any) -> None:
        stamp = message.header.stamp
        print(message.format, f"{time.time() - stamp.sec - stamp.nanosec * 1e-9:.4f}", file=out, flush=True)

    rclpy.init()
    node = rclpy.create_node("receiver")
    node.create_subscription(CompressedImage, TOPIC, write_down, qos())
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        sys.exit(0)


if __name__ == "__main__":
    main()
