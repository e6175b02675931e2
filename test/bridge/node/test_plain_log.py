# SPDX-License-Identifier: Apache-2.0
"""What a peer sends reaches the log of a node as text alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import rclpy
from std_msgs.msg import String

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase

HOSTILE = "cup\x1b[2J\x00\u202e\n[ERROR] [1.0] [registrar]: all is lost"
SHOWN = r"cup\x1b[2J\x00\u202e"


@pytest.fixture
def node() -> Iterator[NodeBase]:
    rclpy.init(args=[])
    made = NodeBase("node")
    yield made
    made.close()
    rclpy.try_shutdown()


def refuse(message: String) -> None:
    raise ValueError(f"expected a label, got {message.data}")


def require_plain(said: str) -> None:
    assert not set("\x1b\x00\u202e") & set(said)
    assert not any(line.startswith("[ERROR] [1.0]") for line in said.splitlines())


@pytest.mark.parametrize("severity", ["info", "warning", "warn", "error", "fatal"])
def test_every_severity_is_logged_as_plain_text(
    severity: str, node: NodeBase, capfd: pytest.CaptureFixture[str]
) -> None:
    for text in (HOSTILE, ValueError(HOSTILE)):
        getattr(node.get_logger(), severity)(text)
    said = "".join(capfd.readouterr())
    require_plain(said)
    assert said.count(SHOWN) == 2 and said.count("all is lost") == 2


def test_severities_may_come_in_turn(node: NodeBase, capfd: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        node.get_logger().info("one")
        node.get_logger().warning("two")
        node.get_logger().error("three")
    assert "".join(capfd.readouterr()).count("\n") == 6


def test_what_a_peer_sends_is_logged_as_plain_text(node: NodeBase, capfd: pytest.CaptureFixture[str]) -> None:
    peer = rclpy.create_node("peer")
    publisher = peer.create_publisher(String, "labels", qos.stage())
    node.listen(String, "labels", refuse, qos.stage())
    sent = HOSTILE.replace("\x00", "")  # which DDS would end the text at
    for _ in range(200):
        publisher.publish(String(data=sent))
        rclpy.spin_once(node, timeout_sec=0.05)
        said = "".join(capfd.readouterr())
        if "labels ignored" in said:
            break
    peer.destroy_node()
    require_plain(said)
    assert r"cup\x1b[2J\u202e" in said
