# SPDX-License-Identifier: Apache-2.0
"""Odometry goes on, or begins anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from objreg_mapper.adapters.odometry_in import OdometryIn
from objreg_mapper.restart import Anew
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.frames import Odometry

from .standing_by import body_at


def test_what_goes_on_is_followed_what_leaps_once_is_passed_over_and_time_that_jumps_begins_anew(
    around: Callable[..., Any],
) -> None:
    graph = around()
    node = NodeBase("follower")
    graph.nodes.append(node)
    graph.executor.add_node(node)
    followed: list[int] = []
    anew: list[Anew] = []
    odom = OdometryIn(node, lambda sample: followed.append(sample.stamp_ns), anew.append)
    graph.wait(graph.odom.get_subscription_count)
    graph.pass_time(0.3)
    for stamp, place in ((50, 50), (51, 51), (52, 900), (53, 53), (1, 1), (2, 2), (3, 3), (4, 4)):
        sample = Odometry(T_odom_body=body_at(place), stamp_ns=stamp * 10**9, child_frame_id="base_link")
        graph.odom.publish(to_msg.odometry(sample))
    graph.wait(lambda: followed and followed[-1] == 4 * 10**9)
    assert [stamp // 10**9 for stamp in followed] == [50, 51, 53, 1, 2, 3, 4]
    assert (odom.passed_over, anew) == (1, [Anew.TIME])
