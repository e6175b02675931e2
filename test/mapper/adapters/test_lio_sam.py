# SPDX-License-Identifier: Apache-2.0
"""What a stand-in for LIO-SAM receives."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray

from objreg_mapper.adapters.lio_sam import TOPIC, ToLioSam

from .standing_by import Around, closure

AS_LIO_SAM = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def stand_in(around: Around) -> list[tuple[float, list[float]]]:
    """When something came, and what."""
    received: list[tuple[float, list[float]]] = []
    put = lambda message: received.append((time.monotonic(), list(message.data)))  # noqa: E731
    around.node.create_subscription(Float64MultiArray, TOPIC, put, AS_LIO_SAM)
    return received


def test_pairs_go_one_a_period_the_later_moment_first_and_near_ones_are_dropped(around: Callable[..., Any]) -> None:
    graph = around("period:=1.0")
    node = graph.start(ToLioSam)
    graph.send(closure(1.5, 63.25), closure(1.5, 31.0), closure(2.5, 64.25), closure(3.5, 65.25))
    graph.wait(lambda: node.accounting.balance().received == 4)
    graph.pass_time(1.2)
    assert node.accounting.balance().waiting == 3  # nobody listens yet
    received = stand_in(graph)
    graph.wait(lambda: len(received) == 3)
    assert [data for _, data in received] == [
        pytest.approx(pair, abs=1e-9) for pair in ([63.25, 1.5], [64.25, 2.5], [65.25, 3.5])
    ]
    assert received[2][0] - received[0][0] > 1.9
    balance = node.accounting.balance()
    assert (balance.published, balance.dropped) == (3, {"too_near": 1})
