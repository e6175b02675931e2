# SPDX-License-Identifier: Apache-2.0
"""What a stand-in for RTAB-Map is asked, with its real messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future

from objreg_mapper.adapters import rtabmap
from objreg_mapper.adapters.rtabmap import ToRtabmap
from objreg_mapper.constraint import Constraint, compensated, local_information
from objreg_ros.bridge.messages import motion_from_msg, to_msg
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import inverse

from .standing_by import AHEAD, AHEAD_TEXT, COVARIANCE, MEASURED, Around, body_at, closure

needs_messages = pytest.mark.skipif(find_spec("rtabmap_msgs") is None, reason="no rtabmap_msgs here")
STAMPS = (1.5, 2.5, 62.25, 63.25)


class StandIn:
    """Offers add_link and get_map_data and publishes mapData, as RTAB-Map's node does."""

    def __init__(self, around: Around, stamps: Sequence[float] = STAMPS) -> None:
        self.links: list[Any] = []
        self.stamps = stamps
        self._executor: SingleThreadedExecutor = around.executor
        self.node = rclpy.create_node("rtabmap")
        self.node.create_service(rtabmap.AddLink, "rtabmap/add_link", self._add)
        self.node.create_service(rtabmap.GetMap, "rtabmap/get_map_data", self._get)
        self.maps = self.node.create_publisher(rtabmap.MapData, "mapData", 1)
        around.executor.add_node(self.node)

    def _add(self, request: Any, response: Any) -> Any:
        self.links.append(request.link)
        return response

    def _get(self, request: Any, response: Any) -> Any:
        assert request.graph_only and request.global_map
        response.data = self.map()
        return response

    def map(self, first: int = 1) -> Any:
        from rtabmap_msgs.msg import Node

        nodes = []
        for k, stamp in enumerate(self.stamps):
            nodes.append(Node(id=first + k, stamp=stamp))
            nodes[-1].pose = to_msg.pose(body_at(stamp))
        return rtabmap.MapData(nodes=nodes)

    def end(self) -> None:
        self._executor.remove_node(self.node)
        self.node.destroy_node()


@needs_messages
def test_a_link_between_the_nodes_of_both_moments_arrives_field_by_field(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToRtabmap)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().waiting == 1)
    graph.pass_time(0.5)
    stand_in = StandIn(graph)
    graph.wait(lambda: node.accounting.balance().published == 1)
    (link,) = stand_in.links
    assert (link.from_id, link.to_id, link.type) == (1, 4, 4)
    expected = compensated(Constraint(MEASURED, COVARIANCE), AHEAD, inverse(AHEAD))
    np.testing.assert_allclose(motion_from_msg.motion(link), expected.T_from_to, atol=1e-9)
    information = np.reshape(link.information, (6, 6))
    np.testing.assert_allclose(information, local_information(expected), rtol=1e-9, atol=1e-5)
    stand_in.end()


@needs_messages
def test_moments_between_nodes_are_carried_to_them_by_odometry(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToRtabmap)
    graph.drive(node, 0.0, 64.0)
    stand_in = StandIn(graph)
    graph.send(closure(2.0, 63.0))
    graph.wait(lambda: node.accounting.balance().published == 1)
    (link,) = stand_in.links
    assert (link.from_id, link.to_id) in {(1, 4), (2, 4)}
    at = {1: 1.5, 2: 2.5, 4: 63.25}[link.from_id]
    T_from_to = AHEAD @ MEASURED @ inverse(AHEAD)
    there, back = inverse(body_at(at)) @ body_at(2.0), inverse(body_at(63.0)) @ body_at(63.25)
    np.testing.assert_allclose(motion_from_msg.motion(link), there @ T_from_to @ back, atol=1e-9)
    stand_in.end()


@needs_messages
def test_it_outlives_rtabmap_and_forgets_the_nodes_of_a_database_that_is_gone(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "patience:=0.3")
    node = graph.start(ToRtabmap)
    first = StandIn(graph)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().published == 1)
    first.end()
    graph.wait(lambda: not by_key(*node.own_diagnostics())["add_link"])
    graph.send(closure(1.5, 62.25))
    graph.pass_time(0.5)
    assert node.accounting.balance().waiting == 1
    second = StandIn(graph, stamps=(101.5, 163.25))
    graph.send(closure(101.5, 163.25))
    graph.wait(lambda: node.accounting.balance().waiting == 0)
    assert [(link.from_id, link.to_id) for link in second.links] == [(1, 2)]
    assert node.accounting.balance().dropped == {"no_node": 1}
    second.end()


@needs_messages
def test_a_moment_far_from_every_node_is_dropped_after_its_patience(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "patience:=0.3")
    node = graph.start(ToRtabmap)
    stand_in = StandIn(graph)
    graph.send(closure(30.0, 63.25), closure(1.5, 1.6))
    graph.wait(lambda: node.accounting.balance().dropped == {"no_node": 1, "same_node": 1})
    assert not stand_in.links
    stand_in.end()


@needs_messages
def test_a_link_that_nobody_answers_is_asked_again_and_then_given_up(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "answer_within:=0.2", "most_attempts:=3")
    node = graph.start(ToRtabmap)
    asked: list[Any] = []

    def ask(request: Any) -> Future:
        asked.append(request)
        return Future()  # as of a process that is gone by now

    monkeypatch.setattr(node._add, "call_async", ask)
    stand_in = StandIn(graph)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().dropped == {"unanswered": 1})
    assert len(asked) == 3 and asked[0] == asked[2]
    stand_in.end()


@needs_messages
def test_a_link_whose_answer_is_an_error_is_given_up_too(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "most_attempts:=3")
    node = graph.start(ToRtabmap)
    asked: list[Any] = []

    def ask(request: Any) -> Future:
        asked.append(request)
        future = Future()
        future.set_exception(RuntimeError("no answer that can be read"))
        return future

    monkeypatch.setattr(node._add, "call_async", ask)
    stand_in = StandIn(graph)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().dropped == {"unanswered": 1})
    graph.pass_time(0.3)
    assert len(asked) == 3
    stand_in.end()


@needs_messages
def test_a_link_that_is_withdrawn_on_its_way_is_counted_once_rtabmap_has_it(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "most_waiting:=1")
    node = graph.start(ToRtabmap)
    answer = Future(executor=graph.executor)
    monkeypatch.setattr(node._add, "call_async", lambda _request: answer)
    stand_in = StandIn(graph)
    graph.send(closure())
    graph.wait(lambda: node._asked is not None)
    graph.send(closure(1.5, 62.25))
    graph.wait(lambda: node.accounting.balance().dropped == {"queue_full": 1})
    assert list(node.waiting) == [closure().moments]
    node._keys["its id"] = closure().moments
    node._retract("its id")
    answer.set_result(rtabmap.AddLink.Response())
    graph.wait(lambda: by_key(*node.own_diagnostics())["retracted too late"] == 1)
    assert node.accounting.balance().dropped == {"queue_full": 1, "retracted": 1}
    stand_in.end()


@needs_messages
def test_a_graph_that_nobody_answers_with_is_asked_for_again(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}", "answer_within:=0.2")
    node = graph.start(ToRtabmap)
    silent, ask = [Future()], node._get.call_async
    monkeypatch.setattr(node._get, "call_async", lambda request: silent.pop() if silent else ask(request))
    stand_in = StandIn(graph)
    graph.wait(lambda: by_key(*node.own_diagnostics())["nodes of rtabmap"] == len(STAMPS))
    assert not silent and not node._wants_graph
    stand_in.end()


@needs_messages
def test_news_of_another_database_in_map_data_alone_is_seen(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToRtabmap)
    stand_in = StandIn(graph)
    graph.wait(lambda: by_key(*node.own_diagnostics())["nodes of rtabmap"] == len(STAMPS))
    graph.wait(stand_in.maps.get_subscription_count)
    stand_in.stamps = (101.5, 163.25)
    stand_in.maps.publish(stand_in.map())
    graph.wait(lambda: by_key(*node.own_diagnostics())["other databases"] == 1)
    graph.wait(lambda: by_key(*node.own_diagnostics())["nodes of rtabmap"] == 2)
    stand_in.end()


@needs_messages
def test_a_map_that_is_none_is_counted_and_ends_nothing(around: Callable[..., Any]) -> None:
    graph = around(f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToRtabmap)
    stand_in = StandIn(graph)
    graph.wait(lambda: by_key(*node.own_diagnostics())["nodes of rtabmap"] == len(STAMPS))
    graph.wait(stand_in.maps.get_subscription_count)
    stand_in.stamps = (-5.0,)
    stand_in.maps.publish(stand_in.map(first=9))
    graph.wait(lambda: node._ignored["malformed mapData"] == 1)
    graph.send(closure())
    graph.wait(lambda: node.accounting.balance().published == 1)
    stand_in.end()


def test_without_its_messages_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rtabmap, "AddLink", None)
    with pytest.raises(ValueError, match=r"rtabmap_msgs.*apt install"):
        ToRtabmap()
