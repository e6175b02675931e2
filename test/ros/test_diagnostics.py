# SPDX-License-Identifier: Apache-2.0
"""What ROS's own tools see of a running node: its level on ``/diagnostics``, and the QoS that parameters gave it."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Image

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos

from .graph import START_S, Graph
from .moments import SECOND

pytestmark = pytest.mark.ros

RELIABLE = "-p qos_overrides./image.subscription.reliability:=reliable"


@pytest.fixture(scope="module")
def running(graph: Graph, tiny_model: Path) -> Graph:
    """A detector that is quick to report, and listens reliably by an override of its QoS."""
    graph.start("/detector", "detector", f"-p model:={tiny_model}", "-p silence:=2.0", RELIABLE)
    graph.wait_for(lambda: "/detector" in graph.status, START_S, "diagnostics")
    return graph


def image(stamp_ns: int, encoding: str) -> Image:
    data = bytes(48)
    return Image(header=to_msg.header(stamp_ns, "eye"), height=6, width=8, encoding=encoding, step=8, data=data)


def see_until(graph: Graph, encoding: str, level: bytes, stamp_ns: int) -> int:
    """Publish pictures, ten a second, until the detector reports a level with some of them; the next stamp."""

    def there() -> bool:
        nonlocal stamp_ns
        if graph.counters["/detector"].received > before and graph.status["/detector"].level == level:
            return True
        graph.publish("image", image(stamp_ns, encoding))
        stamp_ns += SECOND // 10
        time.sleep(0.1)
        return False

    before = graph.counters["/detector"].received
    graph.wait_for(there, what=f"level {level!r}, got {graph.status['/detector']}")
    return stamp_ns


def test_an_override_makes_a_subscription_reliable(running: Graph) -> None:
    (info,) = running.node.get_subscriptions_info_by_topic("/image")
    assert info.qos_profile.reliability == qos.stage().reliability
    (info,) = running.node.get_subscriptions_info_by_topic("/image/compressed")
    assert info.qos_profile.reliability == qos.sensor(False).reliability


def test_a_node_warns_where_every_picture_is_malformed_and_no_more_once_they_are_good(running: Graph) -> None:
    later = see_until(running, "yuv9", DiagnosticStatus.WARN, SECOND)
    said = running.status["/detector"].message
    while "everything was dropped" not in said:  # it warned of silence before the first picture
        later = see_until(running, "yuv9", DiagnosticStatus.WARN, later)
        said = running.status["/detector"].message
    assert "as malformed image (" in said and "got 'yuv9'" in said
    see_until(running, "mono8", DiagnosticStatus.OK, later)
    assert running.counters["/detector"].published > 0


def test_an_override_that_is_no_qos_ends_a_node_with_one_line(running: Graph, tiny_model: Path) -> None:
    wrong = RELIABLE.replace(":=reliable", ":=sometimes")
    ended = subprocess.run(
        running.command("detector", f"-p model:={tiny_model}", wrong, "-r __ns:=/", "-r __node:=other"),
        env=running.environment(), capture_output=True, text=True, timeout=START_S,
    )  # fmt: skip
    assert ended.returncode == 1
    (line,) = [line for line in ended.stderr.strip().splitlines() if "[INFO]" not in line]
    assert "qos_overrides of image: " in line and "`sometimes`" in line
