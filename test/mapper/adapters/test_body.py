# SPDX-License-Identifier: Apache-2.0
"""Who says where the camera sits, and how long one waits for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from objreg_mapper.adapters.body import Body
from objreg_mapper.adapters.params import BodyParams
from objreg_ros.bridge.camera import transforms
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.frames import Odometry

from .standing_by import AHEAD, AHEAD_TEXT, Around, closure


def made(graph: Around) -> Body:
    node = NodeBase("somebody", BodyParams)
    graph.nodes.append(node)  # type: ignore[arg-type]
    graph.executor.add_node(node)
    return Body(node)


def test_the_parameter_counts_more_than_anything(around: Callable[..., Any]) -> None:
    T = made(around(f"T_base_camera:={AHEAD_TEXT}")).of(closure())
    np.testing.assert_allclose(T, AHEAD, atol=1e-9)


def test_a_camera_that_is_the_body_sits_where_the_body_is(around: Callable[..., Any]) -> None:
    np.testing.assert_array_equal(made(around("base_frame:=camera")).of(closure()), np.eye(4))


def test_nothing_is_assumed_of_frames_that_nobody_ties(around: Callable[..., Any]) -> None:
    where = made(around())
    said: list[str] = []
    where._remind = lambda _reason, text: said.append(text)  # type: ignore[method-assign, assignment]
    assert where.of(closure()) is None
    assert "expected to know where 'camera' sits on 'base_link'" in said[0] and "set T_base_camera" in said[0]


def test_tf_static_says_it_for_the_body_that_odometry_is_of(around: Callable[..., Any]) -> None:
    if transforms.TFMessage is None:
        pytest.skip("tf2_msgs is not installed")
    graph = around()
    where = made(graph)
    publisher = graph.node.create_publisher(transforms.TFMessage, "/tf_static", qos.latched())
    publisher.publish(transforms.TFMessage(transforms=[to_msg.transform(AHEAD, 0, "hull", "camera")]))
    sample = Odometry(T_odom_body=np.eye(4), stamp_ns=0, child_frame_id="hull")
    graph.wait(lambda: where.of(closure(), sample) is not None)
    np.testing.assert_allclose(where.of(closure(), sample), AHEAD, atol=1e-9)
    assert where.of(closure()) is None  # of base_link nothing is known
