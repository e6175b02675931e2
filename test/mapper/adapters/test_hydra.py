# SPDX-License-Identifier: Apache-2.0
"""What a stand-in for Hydra receives."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mapper.formats.blank import blank, numbers
from objreg_mapper.adapters import hydra
from objreg_mapper.adapters.hydra import ToHydra
from objreg_mapper.constraint import Constraint, compensated, inverted
from objreg_mapper.formats.pose_graph_tools import fill_edge
from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.bridge.node import qos
from objreg_ros.geometry import inverse

from .standing_by import AHEAD, AHEAD_TEXT, COVARIANCE, MEASURED, closure

needs_messages = pytest.mark.skipif(find_spec("pose_graph_tools_msgs") is None, reason="no pose_graph_tools_msgs here")


@needs_messages
def test_an_edge_between_bodies_arrives_field_by_field_once_hydra_listens(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "robot:=2")
    node = graph.start(ToHydra)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().waiting == 1)
    received: list[Any] = []
    graph.node.create_subscription(hydra.PoseGraph, "external_loop_closures", received.append, qos.stage())
    graph.wait(lambda: received)
    (edge,) = received[0].edges
    assert (edge.key_from, edge.key_to, edge.type) == (1_500_000_000, 63_250_000_000, edge.LOOPCLOSE)
    assert (edge.robot_from, edge.robot_to) == (2, 2)
    expected = inverted(compensated(Constraint(MEASURED, COVARIANCE), AHEAD, inverse(AHEAD)))
    np.testing.assert_allclose(motion_from_msg.motion(edge), AHEAD @ inverse(MEASURED) @ inverse(AHEAD), atol=1e-9)
    np.testing.assert_allclose(np.reshape(edge.covariance, (6, 6)), expected.covariance, atol=1e-9)
    by_hand = fill_edge(SimpleNamespace(pose=blank()), closure(), AHEAD)
    p, q = edge.pose.position, edge.pose.orientation
    assert [p.x, p.y, p.z, q.x, q.y, q.z, q.w] == pytest.approx(numbers(by_hand.pose), abs=1e-9)


def test_without_its_messages_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hydra, "PoseGraph", None)
    with pytest.raises(ValueError, match=r"pose_graph_tools_msgs.*colcon"):
        ToHydra()
