# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.event_handler import EventHandler, SubscriptionEventCallbacks
from rclpy.node import Node
from std_msgs.msg import Header

from objreg_ros.bridge.process.sparing_executor import LOOK_S, SparingExecutor


@pytest.fixture
def context() -> Iterator[Context]:
    made = Context()
    made.init(args=[])
    yield made
    made.try_shutdown()


def test_who_is_connected_is_known_and_messages_come(context: Context) -> None:
    executor, node = SparingExecutor(context=context), Node("sparing", context=context)
    matched, received = list[Any](), list[Any]()
    events = SubscriptionEventCallbacks(matched=matched.append)
    node.create_subscription(Header, "spared", received.append, 10, event_callbacks=events)
    publisher = node.create_publisher(Header, "spared", 10)
    node.create_timer(0.01, lambda: publisher.publish(Header(frame_id="here")))
    executor.add_node(node)
    end = time.monotonic() + 60.0
    while not (matched and received) and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    executor.remove_node(node)
    node.destroy_node()
    executor.shutdown()
    assert matched[-1].current_count == 1 and received[0].frame_id == "here"


def test_events_are_looked_at_once_in_a_while_and_messages_always(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    executor = SparingExecutor(context=context)
    group = SimpleNamespace(can_execute=lambda entity: True)
    event, message = object.__new__(EventHandler), SimpleNamespace(_executor_event=False, callback_group=group)
    event._executor_event, event.callback_group = False, group
    looks = []
    for now_s in (100.0, 100.0 + 0.4 * LOOK_S, 100.0 + 0.8 * LOOK_S, 100.0 + 1.3 * LOOK_S, 100.0 + 1.5 * LOOK_S):
        monkeypatch.setattr(time, "monotonic", lambda now_s=now_s: now_s)
        executor._begin_round()
        assert executor.can_execute(message)
        looks.append(executor.can_execute(event))
    executor.shutdown()
    assert looks == [True, False, False, False, True]
