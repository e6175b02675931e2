# SPDX-License-Identifier: Apache-2.0
"""`objreg metrics`: the counters of a running graph for Prometheus."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from objreg_tools.cli.metrics.exposition import Exposition
from objreg_tools.cli.metrics.observed import Observed
from objreg_tools.cli.watching.listening import careful, listening
from objreg_tools.cli.watching.local_pages import served
from objreg_tools.cli.watching.reports import report_of

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

PORT = 9464  # of OpenMetrics exporters, by custom


@click.command()
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="Port of the metrics; 0: any."
)
def command(port: int) -> None:
    """Serve the counters of a running graph at http://127.0.0.1:9464/metrics, for a Prometheus on this machine only.

    Closures, refusals by reason, frames and latencies of every node, and whether a stream is doubted. It listens to
    `/diagnostics`, to nodes of every namespace, changes nothing, and ends with Ctrl-C. The domain is that of
    ROS_DOMAIN_ID. It needs the extra `objreg_ros[metrics]`.
    """
    observed = Observed()
    exposition = Exposition(observed)
    with listening(partial(listener, observed=observed)) as executor, served(exposition.pages, port) as address:
        click.echo(f"{address}metrics has the metrics; Ctrl-C ends it")
        while True:
            executor.spin_once(timeout_sec=0.2)


def listener(context: Context, observed: Observed) -> Node:
    """A node that takes in what every node reports."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.node import Node

    from objreg_ros.bridge.node import qos

    def take(message: Any) -> None:
        for reported in filter(None, map(report_of, message.status)):
            observed.report(*reported)

    node = Node("objreg_metrics", context=context, start_parameter_services=False)
    node.create_subscription(DiagnosticArray, "/diagnostics", careful(node, take), qos.stage(depth=100))
    return node
